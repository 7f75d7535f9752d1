// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "d2lio/liosam/adapter.hpp"
#include "d2lio/liosam/guess_covariance.hpp"
#include "d2lio/ros/record.hpp"
#include "d2lio/ros/settings.hpp"
#if D2LIO_ROS == 1
#include <sensor_msgs/Imu.h>
#else
#include <sensor_msgs/msg/imu.hpp>
#endif

namespace d2lio {
namespace liosam {

/// What a patched LIO-SAM calls: patches/lio_sam/GLUE.md. C++14; names no type of upstream. With
/// mode off, method none and no record asked for it leaves everything to upstream, bit for bit.
///
/// A pose is upstream's six floats: roll, pitch, yaw (rad), x, y, z (m), of the LiDAR's axes.
class UpstreamGlue {
  public:
    /// Reads and checks all parameters under d2lio/; with a prior, subscribes to the IMU.
    /// @throws std::invalid_argument naming every wrong key, its value and what is allowed.
    template <class Host>
    void configure(Host& host) {
#if D2LIO_ROS == 1
        auto& node = host.nh;
#else
        Host& node = host;
#endif
        ros_glue::SettingsReader settings(node);
        std::string csv, topic = "-";
        GuessNoise noise;
        settings.read("diagnostics.csv", csv);
        settings.read("diagnostics.topic", topic);
        settings.read("mapping.variance", variance_, 1e-9);
        settings.read("imu.correction_rotation", noise.correction_rotation, 1e-9);
        settings.read("imu.correction_translation", noise.correction_translation, 1e-9);
        settings.read("imu.degenerate_rotation", noise.degenerate_rotation, 1e-9);
        settings.read("imu.degenerate_translation", noise.degenerate_translation, 1e-9);
        adapter_.set_map_voxel(host.mappingSurfLeafSize);
        recorder_.open_csv(csv, settings);
        settings.finish(adapter_, {"diagnostics.csv", "diagnostics.topic", "mapping.variance",
                                   "imu.correction_rotation", "imu.correction_translation",
                                   "imu.degenerate_rotation", "imu.degenerate_translation"});
        if (adapter_.reads_surfaces() || adapter_.counts_rows()) {  // upstream shows no rows
            throw std::invalid_argument(
                std::string("D2-LIO cannot start:\n  degeneracy.method = ") +
                (adapter_.counts_rows() ? "xicp" : "noise_aware") +
                ": not inside LIO-SAM; allowed there: none, paper, remap, tsvd");
        }
        changes_ = adapter_.rejects() || adapter_.has_prior();
        if (topic == "-") topic = changes_ ? "d2lio/diagnostics" : "";
        recorder_.advertise(node, topic, "lio_sam");
        if (!adapter_.has_prior()) return;
        noise.accel = host.imuAccNoise;
        noise.gyro = host.imuGyrNoise;
        noise.accel_bias = host.imuAccBiasN;
        noise.gyro_bias = host.imuGyrBiasN;
        noise.gravity = host.imuGravity;
        guess_->configure(noise);
        subscribe(host, node);
    }

    /// @param stamp of the scan that is about to be processed, s. @param pose last estimate, the
    /// graph's correction included.
    void before_guess(double stamp, const float* pose) {
        if (!active()) return;
        previous_ = copy_of(pose);
        // The first scan makes the map. Any later one that was not matched left a mere guess, and
        // its error goes on growing.
        if (matched_ || scans_ == 1) {
            guess_->correct(stamp_, previous_.view(), matched_ && degenerate_);
        }
        if (scans_ < 2) ++scans_;
        matched_ = false;
        stamp_ = stamp;
    }

    /// @param guess of this scan; one that is not finite is replaced by the last pose, for it would
    /// end the node in its search. @param corners, surfaces that will be offered.
    void begin_scan(float* guess, int corners, int surfaces) {
        if (!active()) return;
        if (changes_) keep_finite(guess);
        const PoseCopy predicted = copy_of(guess);
        double P[36] = {};
        for (int i = 0; i < 6; ++i) P[7 * i] = 1.0;  // only a prior looks at it
        const bool known = !adapter_.has_prior() || guess_->predict(stamp_, P);
        adapter_.begin_scan({previous_.view(), predicted.view(), known ? P : nullptr,
                             static_cast<std::size_t>(corners > 0 ? corners : 0),
                             static_cast<std::size_t>(surfaces > 0 ? surfaces : 0)});
        iterations_ = 0;
    }

    /// Overwrites the squared distance that upstream's gate looks at. Any thread, one feature each.
    template <class Point>
    void gate(Feature feature, int i, const Point& p_lidar, std::vector<float>& sq_distances) {
        if (!active()) return;
        const double x = p_lidar.x, y = p_lidar.y, z = p_lidar.z;
        const std::size_t found = sq_distances.size();
        const float decision =
            adapter_.gate({feature, static_cast<std::size_t>(i), std::sqrt(x * x + y * y + z * z),
                           sq_distances.data(), 1, static_cast<int>(found)});
        if (found < kNeighbours) {
            sq_distances.resize(kNeighbours, std::numeric_limits<float>::infinity());
        }
        if (adapter_.rejects() || found < kNeighbours) sq_distances[kNeighbours - 1] = decision;
    }

    /// @returns the weight to use in place of upstream's `s`; 0 rejects. Any thread.
    float weigh(Feature feature, int i, float s) {
        if (!active()) return s;
        const double weight = adapter_.weigh(feature, static_cast<std::size_t>(i), s);
        return adapter_.rejects() ? static_cast<float>(weight) : s;
    }

    /// Analyses the normal equations and adds the prior. @param AtA 6 x 6, Atb 6 x 1, of float, as
    /// cv::Mat; rows have unit weight.
    template <class Mat>
    void condition(const float* pose, Mat& AtA, Mat& Atb) {
        changed_ = false;
        if (!active()) return;
        double A[36], b[6], x[6];
        for (int c = 0; c < 6; ++c) {
            for (int r = 0; r < 6; ++r) {
                kept_A_[r + 6 * c] = AtA.template at<float>(r, c);
                A[r + 6 * c] = static_cast<double>(kept_A_[r + 6 * c]);
            }
            kept_b_[c] = Atb.template at<float>(c, 0);
            b[c] = static_cast<double>(kept_b_[c]);
            x[c] = static_cast<double>(pose[c]);
        }
        ++iterations_;
        const Status status = adapter_.condition(x, variance_, {A, b});
        if (!adapter_.has_prior() || status != Status::kOk) return;
        changed_ = true;
        write(A, b, AtA, Atb);
    }

    /// The normal equations as the scan alone made them, for upstream's eigenvalue test; a shorter
    /// step (6 x 1) where the scan has begun to step back and forth, none where it is not finite.
    template <class Mat>
    void restore(Mat& AtA, Mat& Atb, Mat& step) {
        if (changed_) write(kept_A_, kept_b_, AtA, Atb);
        if (!changes_) return;
        double A[36], d[6];
        bool finite = true;
        for (int i = 0; i < 36; ++i) A[i] = static_cast<double>(kept_A_[i]);
        for (int i = 0; i < 6; ++i) {
            d[i] = static_cast<double>(step.template at<float>(i, 0));
            finite = finite && std::isfinite(d[i]);
        }
        const auto factor = static_cast<float>(finite ? adapter_.step_factor(d, A) : 0.0);
        if (factor == 1.0F) return;
        for (int i = 0; i < 6; ++i)
            step.template at<float>(i, 0) = factor * float(finite ? d[i] : 0);
    }

    /// Whether a prior has decided on the weak directions of this step.
    bool has_prior() const { return changed_; }

    /// @param pose estimate; as in begin_scan. @param degenerate upstream's own verdict.
    /// @returns the one to publish.
    bool end_scan(float* pose, bool degenerate) {
        degenerate_ = degenerate;
        matched_ = true;
        if (!active()) return degenerate;
        if (changes_) keep_finite(pose);
        const PoseCopy estimate = copy_of(pose);
        // Upstream leaves its loop early only when it has converged.
        adapter_.end_scan(estimate.view(), iterations_ > 0 && iterations_ < kMaxIterations);
        if (adapter_.has_prior()) degenerate_ = adapter_.degenerate();
        if (recorder_.active()) recorder_.write(ros_glue::last_record(adapter_, stamp_));
        return degenerate_;
    }

  private:
    static constexpr std::size_t kNeighbours = 5;
    static constexpr int kMaxIterations = 30;  ///< of upstream's scan matching

    struct PoseCopy {
        double R[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};  ///< column-major
        double t[3] = {0, 0, 0};
        PoseView view() const { return {R, t}; }
    };
    static PoseCopy copy_of(const float* pose) {
        PoseCopy out;
        double rpy[3];
        for (int i = 0; i < 3; ++i) {
            rpy[i] = static_cast<double>(pose[i]);
            out.t[i] = static_cast<double>(pose[3 + i]);
        }
        rotation_from_rpy(rpy, out.R);
        return out;
    }

    /// Remembers a finite pose; puts the last one in the place of another.
    void keep_finite(float* pose) {
        bool finite = true;
        for (int i = 0; i < 6; ++i) finite = finite && std::isfinite(pose[i]);
        for (int i = 0; i < 6; ++i)
            (finite ? last_finite_ : pose)[i] = (finite ? pose : last_finite_)[i];
    }

    template <class Number, class Mat>
    static void write(const Number* A, const Number* b, Mat& AtA, Mat& Atb) {
        for (int c = 0; c < 6; ++c) {
            for (int r = 0; r < 6; ++r) AtA.template at<float>(r, c) = float(A[r + 6 * c]);
            Atb.template at<float>(c, 0) = float(b[c]);
        }
    }

    /// The callback owns what it needs: it may come after this object has gone.
    template <class Host, class Node>
    void subscribe(Host& host, Node& node) {
        const std::shared_ptr<GuessCovariance> guess = guess_;
        Host* const converter = &host;
        const auto take = [guess, converter](const auto& message) {
            const auto imu = converter->imuConverter(*message);
            const auto& a = imu.linear_acceleration;
            const auto& w = imu.angular_velocity;
            const double accel[3] = {a.x, a.y, a.z}, gyro[3] = {w.x, w.y, w.z};
#if D2LIO_ROS == 1
            const double stamp = imu.header.stamp.toSec();
#else
            const double stamp = imu.header.stamp.sec + 1e-9 * imu.header.stamp.nanosec;
#endif
            guess->add_imu(stamp, accel, gyro);
        };
        constexpr int kQueue = 2000;
#if D2LIO_ROS == 1
        using Message = sensor_msgs::ImuConstPtr;
        boost::function<void(const Message&)> callback = take;
        auto subscriber =
            node.template subscribe<sensor_msgs::Imu>(host.imuTopic, kQueue, callback);
        subscriber_ = std::make_shared<decltype(subscriber)>(subscriber);
#else
        using Message = sensor_msgs::msg::Imu;
        subscriber_ = node.template create_subscription<Message>(
            host.imuTopic, rclcpp::SensorDataQoS().keep_last(kQueue),
            [take](const typename Message::ConstSharedPtr message) { take(message); });
#endif
    }

    bool active() const { return changes_ || recorder_.active(); }

    Adapter adapter_;
    std::shared_ptr<GuessCovariance> guess_ = std::make_shared<GuessCovariance>();
    std::shared_ptr<void> subscriber_;
    ros_glue::Recorder recorder_;
    double variance_ = 1e-3;  ///< m^2
    bool changes_ = false, changed_ = false, matched_ = false, degenerate_ = false;
    int scans_ = 0;  ///< two stand for many
    PoseCopy previous_;
    double stamp_ = 0.0;
    int iterations_ = 0;
    float kept_A_[36] = {}, kept_b_[6] = {}, last_finite_[6] = {};
};

}  // namespace liosam
}  // namespace d2lio
