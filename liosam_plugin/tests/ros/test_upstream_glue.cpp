// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "d2lio/liosam/upstream_glue.hpp"
#include "fake_node.hpp"

namespace d2lio::liosam {
namespace {

using test::Imu;

constexpr float kInfinity = std::numeric_limits<float>::infinity();

/// What the glue sees of upstream's mapping node.
struct HostFields {
    float mappingSurfLeafSize = 0.4F;
    double imuAccNoise = 4e-3, imuGyrNoise = 1.6e-3, imuAccBiasN = 6e-5, imuGyrBiasN = 4e-5;
    double imuGravity = 9.80511;
    std::string imuTopic = "imu_raw";
    int converted = 0;
    Imu imuConverter(const Imu& imu) {
        ++converted;
        return imu;
    }
};
#if D2LIO_ROS == 1
struct Host : HostFields {
    test::Node nh;
};
test::Node& node_of(Host& host) { return host.nh; }
#else
struct Host : HostFields, test::Node {};
test::Node& node_of(Host& host) { return host; }
#endif

/// cv::Mat of float, as far as the glue uses it.
class Matrix {
  public:
    explicit Matrix(int columns)
        : columns_(columns), data_(static_cast<std::size_t>(6 * columns)) {}
    template <class T>
    T& at(int r, int c) {
        return data_[static_cast<std::size_t>(r * columns_ + c)];
    }
    bool operator==(const Matrix& o) const { return data_ == o.data_; }

  private:
    int columns_;
    std::vector<float> data_;
};

struct Point {
    float x, y, z, intensity;
};

/// Normal equations of rows of which few bind x.
struct Equations {
    Matrix AtA{6}, Atb{1};
    explicit Equations(float along_x = 1e-4F) {
        std::mt19937 random(3);
        std::normal_distribution<float> noise;
        for (int i = 0; i < 400; ++i) {
            std::array<float, 6> row;
            for (float& v : row) v = noise(random);
            row[3] *= along_x;
            for (int r = 0; r < 6; ++r) {
                for (int c = 0; c < 6; ++c) {
                    AtA.at<float>(r, c) += row[std::size_t(r)] * row[std::size_t(c)];
                }
                Atb.at<float>(r, 0) += 0.01F * row[std::size_t(r)];
            }
        }
    }
};

/// The step of iteration i of a scan whose correspondences flip.
Matrix back_and_forth(int i) {
    Matrix step(1);
    step.at<float>(4, 0) = i % 2 == 0 ? 0.01F : -0.01F;
    return step;
}

std::array<float, 6> kPose{0.02F, -0.03F, 1.1F, 5.F, 6.F, 0.5F};

void feed_imu(Host& host, double from, double to) {
    for (int i = 0; from + 0.01 * i <= to; ++i) {
        test::deliver(node_of(host), from + 0.01 * i, 0.0, 0.0, 9.80511);
    }
}

/// Two scans up to the matching of the third: the first made the map.
void begin_third_scan(UpstreamGlue& glue, Host& host, float* guess) {
    feed_imu(host, 10.0, 10.45);
    glue.before_guess(10.0, kPose.data());
    glue.before_guess(10.2, kPose.data());
    glue.begin_scan(kPose.data(), 10, 100);
    glue.end_scan(kPose.data(), false);
    glue.before_guess(10.4, kPose.data());
    glue.begin_scan(guess, 10, 100);
}

TEST(UpstreamGlue, WithoutParametersLeavesEverythingToUpstream) {
    Host host;
    UpstreamGlue glue;
    glue.configure(host);
    EXPECT_TRUE(node_of(host).subscribed.empty());
    EXPECT_TRUE(node_of(host).advertised.empty());
    glue.before_guess(1.0, kPose.data());
    glue.begin_scan(kPose.data(), 10, 100);
    std::vector<float> near{0.1F, 0.2F, 0.3F, 0.4F, 2.5F};
    const std::vector<float> kept = near;
    glue.gate(Feature::kCorner, 3, Point{1.F, 2.F, 3.F, 0.F}, near);
    EXPECT_EQ(near, kept);
    EXPECT_EQ(glue.weigh(Feature::kSurface, 3, 0.05F), 0.05F);
    Equations eq;
    const Equations before = eq;
    glue.condition(kPose.data(), eq.AtA, eq.Atb);
    EXPECT_TRUE(eq.AtA == before.AtA && eq.Atb == before.Atb);
    for (int i = 0; i < 12; ++i) {
        Matrix step = back_and_forth(i), same = step;
        glue.restore(eq.AtA, eq.Atb, step);
        EXPECT_TRUE(step == same);
    }
    EXPECT_TRUE(eq.AtA == before.AtA && eq.Atb == before.Atb);
    EXPECT_FALSE(glue.has_prior());
    EXPECT_TRUE(glue.end_scan(kPose.data(), true));
    EXPECT_FALSE(glue.end_scan(kPose.data(), false));
}

/// Asking for the record alone changes no decision either.
TEST(UpstreamGlue, OffWithARecordCountsAndDecidesNothing) {
    const std::string path = ::testing::TempDir() + "d2lio_liosam_record.csv";
    Host host;
    test::set(node_of(host), "diagnostics/csv", path.c_str());
    {
        UpstreamGlue glue;
        glue.configure(host);
        glue.before_guess(1.0, kPose.data());
        glue.begin_scan(kPose.data(), 1, 2);
        std::vector<float> near{0.1F, 0.2F, 0.3F, 0.4F, 2.5F}, good{0.F, 0.F, 0.F, 0.F, 0.1F};
        const std::vector<float> kept = near;
        glue.gate(Feature::kCorner, 0, Point{1.F, 2.F, 3.F, 0.F}, near);
        glue.gate(Feature::kSurface, 1, Point{1.F, 2.F, 3.F, 0.F}, good);
        EXPECT_EQ(near, kept);
        EXPECT_EQ(glue.weigh(Feature::kSurface, 1, 0.05F), 0.05F);
        EXPECT_EQ(glue.weigh(Feature::kSurface, 1, 0.5F), 0.5F);
        Equations eq;
        const Equations before = eq;
        glue.condition(kPose.data(), eq.AtA, eq.Atb);
        EXPECT_TRUE(eq.AtA == before.AtA && eq.Atb == before.Atb);
        EXPECT_TRUE(glue.end_scan(kPose.data(), true));
        EXPECT_FALSE(glue.end_scan(kPose.data(), false));
    }
    std::ifstream in(path);
    std::string header, row;
    std::getline(in, header);
    std::getline(in, row);
    EXPECT_EQ(header.compare(0, 22, "stamp,offered,accepted"), 0) << header;
    EXPECT_EQ(row.compare(0, 16, "1.000000000,3,1,"), 0) << row;
    std::remove(path.c_str());
}

TEST(UpstreamGlue, TellsEveryWrongKeyAtOnce) {
    Host host;
    test::set(node_of(host), "rejection/mode", "kis");
    test::set(node_of(host), "mapping/variance", 0.0);
    test::set(node_of(host), "imu/correction_rotation", "soft");
    test::set(node_of(host), "upstream_fixes", true);
    try {
        UpstreamGlue().configure(host);
        FAIL() << "accepted";
    } catch (const std::invalid_argument& e) {
        const std::string why = e.what();
        for (const char* part :
             {"d2lio/rejection/mode = kis: allowed: one of off", "d2lio/mapping/variance = 0: ",
              "d2lio/imu/correction_rotation = soft: allowed: a number >= ",
              "d2lio/upstream_fixes = true: unknown; there are"}) {
            EXPECT_NE(why.find(part), std::string::npos) << part << "\nin\n" << why;
        }
    }
}

TEST(UpstreamGlue, TheModeDecidesInPlaceOfTheDistanceGate) {
    Host host;
    test::set(node_of(host), "rejection/mode", "fixed");
    test::set(node_of(host), "rejection/tau", 1.5);
    UpstreamGlue glue;
    glue.configure(host);
    EXPECT_TRUE(node_of(host).subscribed.empty());  // no prior, no covariance
    glue.before_guess(1.0, kPose.data());
    glue.begin_scan(kPose.data(), 10, 100);
    const Point p{3.F, 4.F, 0.F, 0.F};
    std::vector<float> wide{2.F, 3.F, 4.F, 5.F, 6.F};
    glue.gate(Feature::kCorner, 0, p, wide);
    EXPECT_EQ(wide[4], 0.F);
    EXPECT_GT(glue.weigh(Feature::kCorner, 0, -0.5F), 0.1F);
    std::vector<float> far{2.3F, 3.F, 4.F, 5.F, 6.F};
    glue.gate(Feature::kSurface, 0, p, far);
    EXPECT_EQ(far[4], kInfinity);
    std::vector<float> few{0.1F, 0.2F};
    glue.gate(Feature::kSurface, 1, p, few);
    ASSERT_EQ(few.size(), 5U);
    EXPECT_EQ(few[4], kInfinity);
    EXPECT_EQ(glue.weigh(Feature::kSurface, 2, std::nanf("")), 0.F);
}

TEST(UpstreamGlue, ThePriorIsInTheSolveButNotInTheEigenvalueTest) {
    Host host;
    test::set(node_of(host), "degeneracy/method", "paper");
    UpstreamGlue glue;
    glue.configure(host);
    EXPECT_EQ(node_of(host).subscribed, "imu_raw");
    begin_third_scan(glue, host, kPose.data());
    EXPECT_GT(host.converted, 40);
    std::array<float, 6> moved = kPose;
    moved[3] += 0.2F;  // along x, where the scan is blind
    Equations eq;
    const Equations before = eq;
    glue.condition(moved.data(), eq.AtA, eq.Atb);
    EXPECT_TRUE(glue.has_prior());
    EXPECT_GT(eq.AtA.at<float>(3, 3), 100.F * Equations().AtA.at<float>(3, 3));
    EXPECT_LT(eq.Atb.at<float>(3, 0), 0.F);  // back to the guess
    Matrix step = back_and_forth(0), same = step;
    glue.restore(eq.AtA, eq.Atb, step);
    EXPECT_TRUE(eq.AtA == before.AtA && eq.Atb == before.Atb && step == same);
    EXPECT_TRUE(glue.end_scan(moved.data(), false));  // our verdict on the scan's own rows
    const auto messages = test::published(node_of(host));
    ASSERT_EQ(messages.size(), 2U);
    EXPECT_NEAR(test::stamp_of(messages[1].second), 10.4, 1e-6);
}

/// Its search ends the node on a point that is no number.
TEST(UpstreamGlue, AModeReplacesAPoseThatIsNoNumber) {
    Host host;
    test::set(node_of(host), "rejection/mode", "kiss");
    UpstreamGlue glue;
    glue.configure(host);
    glue.before_guess(10.0, kPose.data());
    glue.begin_scan(kPose.data(), 10, 100);
    std::array<float, 6> lost = kPose;
    lost[4] = std::nanf("");
    glue.end_scan(lost.data(), false);
    EXPECT_EQ(lost, kPose);
    lost[0] = kInfinity;
    glue.before_guess(10.2, kPose.data());
    glue.begin_scan(lost.data(), 10, 100);
    EXPECT_EQ(lost, kPose);
}

/// Upstream's loop ends when a step is small enough: one that steps back and forth must come there.
TEST(UpstreamGlue, AModeShortensTheStepsOfAScanThatOscillates) {
    Host host;
    test::set(node_of(host), "rejection/mode", "none");
    UpstreamGlue glue;
    glue.configure(host);
    glue.before_guess(10.0, kPose.data());  // without a prior it asks for no IMU
    glue.begin_scan(kPose.data(), 10, 100);
    float last = 0.F;
    for (int i = 0; i < 15; ++i) {
        Equations eq;
        glue.condition(kPose.data(), eq.AtA, eq.Atb);
        Matrix step = back_and_forth(i);
        glue.restore(eq.AtA, eq.Atb, step);
        last = std::abs(step.at<float>(4, 0));
        EXPECT_TRUE(i >= 6 || last == 0.01F) << i;
    }
    EXPECT_LT(last, 1e-4F);
    Equations eq;
    Matrix step = back_and_forth(0);
    step.at<float>(1, 0) = std::nanf("");
    glue.condition(kPose.data(), eq.AtA, eq.Atb);
    glue.restore(eq.AtA, eq.Atb, step);
    EXPECT_TRUE(step == Matrix(1));  // no step at all
}

/// A pose that is no number cannot be conditioned: upstream's step stays as it is.
TEST(UpstreamGlue, WithoutAPriorUpstreamsOwnRemedyStays) {
    Host host;
    test::set(node_of(host), "degeneracy/method", "paper");
    UpstreamGlue glue;
    glue.configure(host);
    begin_third_scan(glue, host, kPose.data());
    Equations eq;
    const Equations before = eq;
    std::array<float, 6> steep = kPose;
    steep[1] = std::nanf("");
    glue.condition(steep.data(), eq.AtA, eq.Atb);
    EXPECT_FALSE(glue.has_prior());
    EXPECT_TRUE(eq.AtA == before.AtA && eq.Atb == before.Atb);
}

/// Before any estimate nothing is known of the guess: the scan runs without a prior.
TEST(UpstreamGlue, NoEstimateNoPrior) {
    Host host;
    test::set(node_of(host), "degeneracy/method", "paper");
    UpstreamGlue glue;
    glue.configure(host);
    glue.before_guess(10.0, kPose.data());
    glue.begin_scan(kPose.data(), 10, 100);
    Equations eq;
    glue.condition(kPose.data(), eq.AtA, eq.Atb);
    EXPECT_FALSE(glue.has_prior());
}

/// Scans that upstream does not match leave a guess whose error goes on growing, so the prior of
/// the next match is weaker.
TEST(UpstreamGlue, UnmatchedScansWeakenThePrior) {
    const auto weight = [](int unmatched) {
        Host host;
        test::set(node_of(host), "degeneracy/method", "paper");
        UpstreamGlue glue;
        glue.configure(host);
        begin_third_scan(glue, host, kPose.data());
        glue.end_scan(kPose.data(), false);
        double t = 10.4;
        for (int i = 0; i <= unmatched; ++i) glue.before_guess(t += 0.2, kPose.data());
        glue.begin_scan(kPose.data(), 10, 100);
        Equations eq;
        glue.condition(kPose.data(), eq.AtA, eq.Atb);
        return eq.AtA.at<float>(3, 3);
    };
    EXPECT_GT(weight(0), 2.F * weight(2));
}

}  // namespace
}  // namespace d2lio::liosam
