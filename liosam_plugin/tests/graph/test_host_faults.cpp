// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <sstream>

#include "host_faults.hpp"
#include "liosam_drive.hpp"

/// The fault table on the LIO-SAM host, both presets: the shared suite and what only this host
/// does.
namespace d2lio::test {
namespace {

using liosam::Preset;

template <Preset kPreset>
struct LioSamHost {
    static liosam::Host make(const ParamMap& params) {
        return liosam::Host(kPreset, indoor(params));
    }
    static constexpr double kRoomError = 0.06;  // m
    /// The start, and every second scan where LIO-SAM's mapping interval leaves that out.
    static constexpr std::size_t kWithoutPose = kPreset == Preset::kLioSam ? 20 : 2;
};

using Presets = ::testing::Types<LioSamHost<Preset::kLioSam>, LioSamHost<Preset::kD2Lio>>;
INSTANTIATE_TYPED_TEST_SUITE_P(LioSam, HostFaults, Presets);

template <typename Traits>
class LioSamFaults : public HostFaults<Traits> {};
TYPED_TEST_SUITE(LioSamFaults, Presets);

std::size_t own(const Outcome& r, const std::string& name) {
    for (const auto& [key, count] : r.counts.own) {
        if (key == name) return count;
    }
    ADD_FAILURE() << "no count " << name;
    return 0;
}

double last_error(const Outcome& r) {
    const auto poses = r.poses();
    return poses.empty() ? kInf : largest_error({poses.front(), poses.back()}, 0);
}

TYPED_TEST(LioSamFaults, ASpeedBeyondItsBoundResetsTheGraphAndTheRunGoesOn) {
    const Outcome r = this->run(
        {}, {{"imu.max_speed", "0.2"}, {"degeneracy.method", "none"}});  // the room: 0.6 m/s
    EXPECT_GT(own(r, "graph_speed_resets"), 0U);
    EXPECT_TRUE(r.told("inertial graph reset"));
    EXPECT_EQ(r.counts.resets, 0U);
    this->expect_on_track(r.results);
}

TYPED_TEST(LioSamFaults, ABiasBeyondItsBoundResetsTheGraphAndTheRunGoesOn) {
    Drive drive;
    drive.keep_imu = [](ImuSample& s) {
        if (since_start(s.stamp) > 1.5) s.gyro.z() += 0.1;
        return true;
    };
    const Outcome r = this->run(
        drive, {{"imu.max_bias", "0.02"}, {"imuGyrBiasN", "0.05"}, {"degeneracy.method", "none"}});
    EXPECT_GT(own(r, "graph_bias_resets"), 0U);
    EXPECT_TRUE(r.told("inertial graph reset"));
    EXPECT_EQ(r.counts.resets, 0U);
    this->expect_on_track(r.results);
}

TYPED_TEST(LioSamFaults, RingsOutOfRangeLoseTheirScansOnly) {
    Drive drive;
    drive.edit = [](int i, Scan& s) {
        for (LidarPoint& p : s.points) {
            if (i >= 20 && i < 24) p.ring = static_cast<std::uint16_t>(60000 + p.ring);
        }
        return true;
    };
    const Outcome r = this->run(drive, {{"front_end", "features"}});
    int lost = 0;
    for (std::size_t i = 20; i < 24; ++i) {
        if (!r.results[i].has_pose) continue;
        EXPECT_EQ(r.results[i].status, ScanStatus::kTooFewPoints);
        EXPECT_EQ(r.results[i].health, Health::kLost);
        ++lost;
    }
    EXPECT_GE(lost, 2);
    EXPECT_EQ(r.last_status(), ScanStatus::kOk);
    this->expect_on_track(r.results);
}

TYPED_TEST(LioSamFaults, RingsAbsentAreFoundInCloudsLaserByLaser) {
    Drive drive;
    drive.edit = [](int, Scan& s) {
        std::stable_sort(s.points.begin(), s.points.end(),
                         [](const LidarPoint& a, const LidarPoint& b) { return a.ring < b.ring; });
        for (LidarPoint& p : s.points) p.ring = 0;
        return true;
    };
    this->expect_on_track(this->run(drive, {{"front_end", "features"}}).results);
}

TYPED_TEST(LioSamFaults, RingsAbsentInAnotherOrderAreNeverTakenForAGoodMatch) {
    Drive drive;  // column by column: nothing tells the rings apart
    drive.edit = [](int, Scan& s) {
        for (LidarPoint& p : s.points) p.ring = 0;
        return true;
    };
    const Outcome r = this->run(drive, {{"front_end", "features"}});
    EXPECT_EQ(r.results.size(), 40U);
    for (const ScanResult& x : r.results) {
        EXPECT_NE(x.status, ScanStatus::kOk);
        EXPECT_EQ(x.health == Health::kOk, x.status == ScanStatus::kMapInitialised);
    }
    // The direct front end has no use for rings.
    this->expect_on_track(this->run(drive, {{"front_end", "direct"}}).results);
}

TYPED_TEST(LioSamFaults, FewerRingsThanTheSensorHasAreEnough) {
    this->expect_on_track(this->run({}, {{"N_SCAN", "10"}, {"front_end", "features"}}).results);
}

TYPED_TEST(LioSamFaults, ASensorPitchedByNinetyDegreesIsFollowed) {
    const Mat3 tilt = exp_so3(Vec3(0.0, std::acos(0.0), 0.0));  // R_imu_tilted
    const Pose T = Pose{tilt.transpose(), Vec3::Zero()} * SyntheticRoom::T_imu_lidar();
    std::string R, t;
    for (int row = 0; row < 3; ++row) {
        t += std::to_string(T.t[row]) + " ";
        for (int c = 0; c < 3; ++c) R += std::to_string(T.R(row, c)) + " ";
    }
    Drive drive;
    drive.keep_imu = [&tilt](ImuSample& s) {
        s.gyro = tilt.transpose() * s.gyro;
        s.accel = tilt.transpose() * s.accel;
        return true;
    };
    Outcome r = this->run(drive, {{"mapping.extrinsic_R", R}, {"mapping.extrinsic_T", t}});
    ASSERT_FALSE(r.poses().empty());
    EXPECT_GT(std::abs(r.poses().back().state.rot(2, 0)), 0.99);
    for (ScanResult& x : r.results) x.state.rot *= tilt.transpose();  // back to the truth's axes
    this->expect_on_track(r.results);
}

TYPED_TEST(LioSamFaults, AVehicleThatMovesFromTheFirstSampleOnIsFollowed) {
    constexpr double kMovingError = 0.08;  // m: the start's tilt is that of the mean acceleration
    for (const Stamp begin : {2, 3, 5}) {  // s into the drive
        Drive drive;
        drive.start += begin * 1'000'000'000;
        const Outcome r = this->run(drive);
        EXPECT_LT(largest_error(r.results, TypeParam::kWithoutPose), kMovingError) << begin;
        EXPECT_EQ(r.counts.resets, 0U);
    }
}

TYPED_TEST(LioSamFaults, AnotherRoomAfterTwoSecondsEndsNothing) {
    SyntheticRoom other(7);
    other.half = Vec3(9.3, 2.9, 1.9);
    Drive drive;
    drive.scans = 60;
    drive.edit = [&other](int i, Scan& s) {
        if (i >= 20) s = other.scan(s.stamp);
        return true;
    };
    const Outcome r = this->run(drive);
    EXPECT_EQ(r.results.size(), 60U);
    EXPECT_GE(r.poses().size(), 60U - 3 * TypeParam::kWithoutPose / 2 - 1);
    EXPECT_EQ(r.counts.resets, 0U);
}

TYPED_TEST(LioSamFaults, ThreeSecondsWithoutAMatchAreRecoveredFrom) {
    constexpr double kRecoveredError = 0.05;  // m
    Drive drive;
    drive.scans = 70;
    drive.edit = [](int i, Scan& s) {
        for (LidarPoint& p : s.points) {
            if (i < 20 || i >= 50) break;
            p.x = p.y = 0.0F;  // a vertical line of points far above: nothing is near it in the map
            p.z = 30.0F + static_cast<float>(p.ring);
        }
        return true;
    };
    const Outcome r = this->run(drive);
    EXPECT_GE(own(r, "scans_lost") + own(r, "scans_degenerate"), 10U);
    EXPECT_EQ(r.last_status(), ScanStatus::kOk);
    EXPECT_LT(last_error(r), kRecoveredError);
}

TYPED_TEST(LioSamFaults, AnOrientationThatIsNoneIsIgnored) {
    const Eigen::Vector4d useless[] = {
        Eigen::Vector4d::Constant(kNaN),   Eigen::Vector4d::Zero(),
        Eigen::Vector4d(kInf, 0, 0, kInf), Eigen::Vector4d(0, 0, 0, kNaN),
        Eigen::Vector4d(0.1, 0, 0, 0.1),   Eigen::Vector4d(2, 0, 0, 2)};
    const Outcome without = this->run({});
    for (const Eigen::Vector4d& q : useless) {
        Drive drive;
        drive.keep_imu = [&q](ImuSample& s) {
            s.orientation = q;
            return true;
        };
        const Outcome with = this->run(drive);
        ASSERT_EQ(with.results.size(), without.results.size());
        for (std::size_t i = 0; i < with.results.size(); ++i) {
            ASSERT_EQ(with.results[i].status, without.results[i].status) << q.transpose();
            ASSERT_EQ(with.results[i].state.rot, without.results[i].state.rot) << q.transpose();
        }
    }
}

TYPED_TEST(LioSamFaults, AnExtremelyNoisyImuIsSurvived) {
    constexpr double kNoisyError = 0.05;  // m
    Random random(11);
    Drive drive;
    drive.keep_imu = [&random](ImuSample& s) {
        for (int a = 0; a < 3; ++a) {
            s.gyro[a] += 0.2 * random.normal();
            s.accel[a] += 4.0 * random.normal();
        }
        return true;
    };
    const Outcome r = this->run(drive);
    EXPECT_EQ(r.results.size(), 40U);
    EXPECT_LT(last_error(r), kNoisyError);
}

/// Random subsets of the faults above and more, each striking at random.
class Fuzz {
  public:
    explicit Fuzz(unsigned seed) : engine_(seed), other_(seed) {
        other_.half = Vec3(uniform(2.0, 12.0), uniform(2.0, 12.0), uniform(1.0, 3.0));
        drive.scans = 16;
        drive.start += static_cast<Stamp>(uniform(0.0, 4.0) * 1e9);
        drive.edit = [this](int, Scan& s) { return strike(s, scan_faults_); };
        drive.keep_imu = [this](ImuSample& s) { return strike(s, imu_faults_); };
        choose_params();
        choose_scan_faults();
        choose_imu_faults();
    }
    Fuzz(const Fuzz&) = delete;  // the drive refers to this
    Fuzz& operator=(const Fuzz&) = delete;

    Drive drive;
    ParamMap params;
    std::string faults;  ///< names of what was chosen

  private:
    template <typename T>
    struct Fault {
        double rate;
        std::function<bool(T&)> apply;  ///< false: the message is lost
    };
    template <typename T>
    using Faults = std::vector<Fault<T>>;

    double uniform(double lo, double hi) { return std::uniform_real_distribution(lo, hi)(engine_); }
    bool chance(double p) { return uniform(0.0, 1.0) < p; }
    template <typename T>
    T wild() {
        using L = std::numeric_limits<T>;
        const T inf = L::infinity();
        const T values[] = {L::quiet_NaN(), inf, -inf, 0, 1000, L::max(), L::lowest(), -1};
        return values[engine_() % 8];
    }

    template <typename T>
    bool strike(T& message, const Faults<T>& chosen) {
        for (const Fault<T>& f : chosen) {
            if (chance(f.rate) && !f.apply(message)) return false;
        }
        return true;
    }
    template <typename T>
    void maybe(Faults<T>& chosen, const char* name, double most, std::function<bool(T&)> apply) {
        if (!chance(0.25)) return;
        faults += std::string(name) + " ";
        chosen.push_back({uniform(0.0, most), std::move(apply)});
    }
    void each(const char* name, double most, std::function<void(LidarPoint&)> edit) {
        maybe<Scan>(scan_faults_, name, most, [this, edit = std::move(edit)](Scan& s) {
            const double share = chance(0.5) ? 1.0 : uniform(0.0, 1.0);
            for (LidarPoint& p : s.points) {
                if (chance(share)) edit(p);
            }
            return true;
        });
    }

    void choose_params() {
        const char* const modes[] = {"off", "none", "fixed", "kiss", "point_adaptive"};
        const char* const methods[] = {"none", "paper", "remap", "tsvd", "xicp"};
        params["rejection.mode"] = modes[engine_() % 5];
        params["degeneracy.method"] = methods[engine_() % 3];
        params["front_end"] = chance(0.5) ? "features" : "direct";
        params["deskew"] = chance(0.5) ? "full" : "rotation";
        std::istringstream rare(
            "imu.max_speed=0.1 imu.max_bias=0.001 N_SCAN=5 "
            "mapping.eigenvalue_threshold=1e6 rejection.tau=0 surfFeatureMinValidNum=1 "
            "imuRPYWeight=1 map.max_clouds=10 imu.gap_reset=0.05 lidar.gap_reset=0.5 "
            "columnByOrder=true mapping.variance=1e-9 imu.init_samples=2 "
            "surroundingkeyframeAddingDistThreshold=0 imuAccNoise=1e-9 "
            "imu.correction_translation=1e-9 imu.prior_bias=1e-9 preprocess.blind=0");
        for (std::string text; rare >> text;) {
            const std::size_t split = text.find('=');
            if (chance(0.1)) params[text.substr(0, split)] = text.substr(split + 1);
        }
        for (const auto& [key, value] : params) faults += key + "=" + value + " ";
    }

    void choose_scan_faults() {
        Faults<Scan>& f = scan_faults_;
        maybe<Scan>(f, "lost", 0.6, [](Scan&) { return false; });
        maybe<Scan>(f, "tiny", 0.6, [this](Scan& s) {
            s.points.resize(engine_() % 8);
            return true;
        });
        maybe<Scan>(f, "other_room", 1.0, [this](Scan& s) {
            s = other_.scan(s.stamp);
            return true;
        });
        maybe<Scan>(f, "shuffled", 1.0, [this](Scan& s) {
            std::shuffle(s.points.begin(), s.points.end(), engine_);
            return true;
        });
        maybe<Scan>(f, "scan_stamp", 0.2, [this](Scan& s) {
            s.stamp += static_cast<Stamp>(uniform(-1.0, 1.0) * 1e9);
            return true;
        });
        each("wild_point", 0.5,
             [this](LidarPoint& p) { (chance(0.5) ? p.x : p.z) = wild<float>(); });
        each("ring_lost", 0.6, [this](LidarPoint& p) { p.ring = chance(0.5) ? 0 : 65535; });
        each("same_point", 0.5, [](LidarPoint& p) { p.x = p.y = p.z = 2.0F; });
        each("on_a_line", 0.5, [](LidarPoint& p) { p.y = p.z = 0.5F; });
        each("far", 0.6, [](LidarPoint& p) { p.x *= 10.0F, p.y *= 10.0F, p.z *= 10.0F; });
        each("point_time", 0.3, [this](LidarPoint& p) {
            const std::int32_t times[] = {-1, 0, 50'000'000, 2'000'000'000};
            p.dt_ns = times[engine_() % 4];
        });
    }

    void choose_imu_faults() {
        Faults<ImuSample>& f = imu_faults_;
        const double noise = std::exp(uniform(-3.0, 5.0));
        maybe<ImuSample>(f, "imu_lost", 0.95, [](ImuSample&) { return false; });
        maybe<ImuSample>(f, "imu_noise", 1.0, [this, noise](ImuSample& s) {
            s.gyro += 0.1 * noise * Vec3(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
            s.accel += noise * Vec3(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
            return true;
        });
        maybe<ImuSample>(f, "imu_wild", 0.05, [this](ImuSample& s) {
            (chance(0.5) ? s.gyro : s.accel)[engine_() % 3] = wild<double>();
            return true;
        });
        maybe<ImuSample>(f, "imu_constant", 1.0, [](ImuSample& s) {
            s.gyro = Vec3(0.1, 0.0, 0.0);
            s.accel = Vec3(0.0, 0.0, 9.81);
            return true;
        });
        maybe<ImuSample>(f, "imu_in_g", 1.0, [](ImuSample& s) {
            s.accel /= 9.81;
            return true;
        });
        maybe<ImuSample>(f, "imu_stamp", 0.02, [this](ImuSample& s) {
            s.stamp += static_cast<Stamp>(uniform(-1.0, 0.1) * 1e9);
            return true;
        });
        maybe<ImuSample>(f, "orientation", 1.0, [this](ImuSample& s) {
            s.orientation =
                Eigen::Vector4d(uniform(-1, 1), 0, 0, chance(0.3) ? wild<double>() : 1.0);
            return true;
        });
    }

    std::mt19937 engine_;
    SyntheticRoom other_;
    Faults<Scan> scan_faults_;
    Faults<ImuSample> imu_faults_;
};

TEST(LioSamFuzz, RandomFaultsNeverThrowAndNeverShowNaN) {
    constexpr unsigned kDrives = 200;
    std::size_t results = 0, poses = 0, matched = 0;
    for (unsigned seed = 0; seed < kDrives; ++seed) {
        Fuzz fuzz(seed);
        SCOPED_TRACE("seed " + std::to_string(seed) + ": " + fuzz.faults);
        const auto preset = seed % 2 == 0 ? Preset::kLioSam : Preset::kD2Lio;
        ASSERT_NO_THROW({
            const Outcome r = observe(liosam::Host(preset, indoor(fuzz.params)), fuzz.drive);
            results += r.results.size();
            poses += r.poses().size();
            for (const ScanResult& x : r.results) matched += x.status == ScanStatus::kOk ? 1 : 0;
        });
    }
    EXPECT_GT(results, 10 * kDrives);  // else the faults left nothing to test
    EXPECT_GT(poses, 4 * kDrives);
    EXPECT_GT(matched, kDrives);
}

}  // namespace
}  // namespace d2lio::test
