// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "standin/solve.h"

/// An iterated Kalman filter over a pose, with the functions that the hooks call.
namespace standin {

/// Tangent: position, rotation (right).
constexpr int kStateSize = 6;
using Covariance = Eigen::Matrix<double, kStateSize, kStateSize>;
using Tangent = Eigen::Matrix<double, kStateSize, 1>;

inline Eigen::Quaterniond exp_so3(const Eigen::Vector3d& v) {
    const double angle = v.norm();
    if (angle < 1e-12) return Eigen::Quaterniond::Identity();
    return Eigen::Quaterniond(Eigen::AngleAxisd(angle, v / angle));
}
inline Eigen::Vector3d log_so3(const Eigen::Quaterniond& q) {
    const Eigen::AngleAxisd turn(q);
    return turn.angle() * turn.axis();
}

struct State {
    Eigen::Vector3d pos = Eigen::Vector3d::Zero();
    Eigen::Quaterniond rot = Eigen::Quaterniond::Identity();
    Eigen::Quaterniond offset_R_L_I{Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitZ())};
    Eigen::Vector3d offset_T_L_I{0.05, 0.0, 0.1};

    void add(const Tangent& d) {
        pos += d.head<3>();
        rot = (rot * exp_so3(d.tail<3>())).normalized();
    }
    Tangent minus(const State& other) const {
        Tangent d;
        d.head<3>() = pos - other.pos;
        d.tail<3>() = log_so3(other.rot.conjugate() * rot);
        return d;
    }
};

struct Measurement {
    bool valid = true;
    bool converge = true;  ///< search anew
    Eigen::Matrix<double, Eigen::Dynamic, kStateSize> h_x;
    Eigen::VectorXd h;  ///< negative residuals, m
};

inline Covariance inverse(const Covariance& A) {
    const std::vector<double> entries(A.data(), A.data() + A.size());  // symmetric
    Covariance out;
    for (int c = 0; c < kStateSize; ++c) {
        std::vector<double> unit(kStateSize, 0.0);
        unit[static_cast<std::size_t>(c)] = 1.0;
        unit = solve_dense(entries, unit);
        for (int r = 0; r < kStateSize; ++r) out(r, c) = unit[static_cast<std::size_t>(r)];
    }
    return out;
}

class Filter {
  public:
    using Model = void (*)(State&, Measurement&);

    explicit Filter(Model model) : model_(model), P_(1e-6 * Covariance::Identity()) {}
    State get_x() const { return x_; }
    Covariance get_P() const { return P_; }
    void change_P(const Covariance& P) { P_ = P; }

    void predict(const Eigen::Matrix3d& turn, const Eigen::Vector3d& step, double variance_t,
                 double variance_r) {
        x_.pos += x_.rot * step;
        x_.rot = (x_.rot * Eigen::Quaterniond(turn)).normalized();
        P_.diagonal().head<3>().array() += variance_t;
        P_.diagonal().tail<3>().array() += variance_r;
    }

    /// In information form: any number of rows will do.
    void update_iterated_dyn_share_modified(double variance, double& solve_time) {
        constexpr int kIterations = 4;
        constexpr double kConverged = 1e-3;
        const State prior = x_;
        const Covariance information = inverse(P_);
        Measurement m;
        for (int i = 0; i < kIterations; ++i) {
            m.valid = true;
            model_(x_, m);
            if (!m.valid) continue;
            Covariance A = information;
            Tangent b = -(information * x_.minus(prior));
            for (Eigen::Index r = 0; r < m.h.size(); ++r) {
                const Tangent row = m.h_x.row(r).transpose();
                A += row * row.transpose() / variance;
                b += row * (m.h(r) / variance);
            }
            P_ = inverse(A);
            const Tangent d = P_ * b;
            x_.add(d);
            m.converge = d.cwiseAbs().maxCoeff() < kConverged || i == kIterations - 2;
            solve_time += 1.0;
        }
    }

  private:
    Model model_;
    State x_;
    Covariance P_;
};

}  // namespace standin
