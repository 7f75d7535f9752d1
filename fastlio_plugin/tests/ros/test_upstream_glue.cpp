// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "d2lio/fastlio/upstream_glue.hpp"
#include "fake_node.hpp"

namespace d2lio::fastlio {
namespace {

using test::Node;
using Mat23 = Eigen::Matrix<double, 23, 23>;

constexpr double kVariance = 0.001;
constexpr double kExact = 1e-12;

/// What the glue sees of upstream's types.
struct State {
    Eigen::Vector3d pos{1.0, 2.0, 3.0};
    Eigen::Quaterniond rot{Eigen::AngleAxisd(0.4, Eigen::Vector3d(1.0, 2.0, 3.0).normalized())};
    Eigen::Quaterniond offset_R_L_I{Eigen::AngleAxisd(1.0, Eigen::Vector3d::UnitZ())};
    Eigen::Vector3d offset_T_L_I{0.0, 0.0, 0.5};
};
struct Filter {
    State x;
    Mat23 P = 1e-2 * Mat23::Identity();
    int changes = 0;
    State get_x() const { return x; }
    Mat23 get_P() const { return P; }
    void change_P(Mat23& next) {
        P = next;
        ++changes;
    }
};
struct alignas(16) Point {
    float x = 0.F, y = 0.F, z = 0.F, pad = 1.F;
    float nx = 0.F, ny = 0.F, nz = 0.F, pad2 = 0.F, intensity = -7.F;
};

/// Rows of planes with random normals; along x with few of them.
struct Equations {
    Eigen::MatrixXd H;
    Eigen::VectorXd z;
    explicit Equations(int rows, double along_x = 1.0)
        : H(Eigen::MatrixXd::Zero(rows, 12)), z(rows) {
        std::mt19937 random(7);
        std::normal_distribution<double> noise;
        for (int r = 0; r < rows; ++r) {
            for (int c = 0; c < 6; ++c) H(r, c) = noise(random) * (c == 0 ? along_x : 1.0);
            z(r) = 0.01 * noise(random);
        }
    }
};

/// A scan of `points` of which nothing but the equations is offered.
void run_scan(UpstreamGlue& glue, Filter& kf, Equations& eq, double stamp = 12.5) {
    glue.before_prediction(kf.x);
    glue.begin_scan(stamp, kf.x, kf.P, 400);
    State moved = kf.x;
    moved.pos.x() += 0.3;
    glue.condition(moved, kVariance, eq.H, eq.z);
    kf.x = moved;
    glue.end_scan(kf);
}

std::vector<std::string> cells(const std::string& line) {
    std::vector<std::string> out;
    std::istringstream in(line);
    for (std::string cell; std::getline(in, cell, ',');) out.push_back(cell);
    return out;
}

std::string message_of(Node& node) {
    UpstreamGlue glue;
    try {
        glue.configure(node, 0.5);
    } catch (const std::invalid_argument& e) {
        return e.what();
    }
    return {};
}

TEST(UpstreamGlue, WithoutParametersLeavesEverythingToUpstream) {
    Node node;
    UpstreamGlue glue;
    glue.configure(node, 0.5);
    EXPECT_FALSE(glue.decides());
    Filter kf;
    Equations eq(50, 1e-3);
    const Equations before = eq;
    const Mat23 P = kf.P;
    run_scan(glue, kf, eq);
    EXPECT_EQ(eq.H, before.H);
    EXPECT_EQ(eq.z, before.z);
    EXPECT_EQ(kf.P, P);
    EXPECT_EQ(kf.changes, 0);
    std::array<double, 36> covariance;
    covariance.fill(-3.0);
    glue.fill_covariance(kf.P, covariance);
    for (const double c : covariance) EXPECT_EQ(c, -3.0);
    EXPECT_TRUE(node.advertised.empty());
}

/// The method must see every correspondence, so it decides even where rejection is off.
TEST(UpstreamGlue, NoiseAwareDecidesWithRejectionOff) {
    Node node;
    test::set(node, "degeneracy/method", "noise_aware");
    UpstreamGlue glue;
    glue.configure(node, 0.5);
    EXPECT_TRUE(glue.decides());
    Filter kf;
    Equations eq(50, 1e-3);
    const Equations before = eq;
    run_scan(glue, kf, eq);  // equations that were not offered point by point
    EXPECT_EQ(eq.H, before.H);
    EXPECT_EQ(eq.z, before.z);
    EXPECT_EQ(kf.changes, 0);  // no prior, so nothing to take out of the covariance
}

TEST(UpstreamGlue, SharesThatDoNotFitTogetherAreRefused) {
    Node node;
    test::set(node, "degeneracy/method", "noise_aware");
    test::set(node, "degeneracy/share_low", 1000.0);
    EXPECT_NE(message_of(node).find("share_high"), std::string::npos) << message_of(node);
}

TEST(UpstreamGlue, YamlTruthValuesAreTakenForTheWordsTheyStandFor) {
    Node node;
    test::set(node, "rejection/mode", false);  // YAML reads a bare off as false
    test::set(node, "rejection/keep_host_gate", true);
    UpstreamGlue glue;
    EXPECT_NO_THROW(glue.configure(node, 0.5));
    EXPECT_FALSE(glue.decides());
}

TEST(UpstreamGlue, TellsEveryWrongKeyAtOnce) {
    Node node;
    test::set(node, "rejection/mode", "kis");
    test::set(node, "rejection/tau", std::vector<double>{1.0});
    test::set(node, "rejection/tua", 2.0);
    test::set(node, "degeneracy/w", -1.0);
    test::set(node, "upstream_fixes", "perhaps");
    test::set(node, "diagnostics/csv", "/no/such/folder/x.csv");
    const std::string why = message_of(node);
    for (const char* part :
         {"d2lio/rejection/mode = kis: allowed: one of off, none, fixed, kiss, point_adaptive",
          "d2lio/rejection/tau = (not a single value): allowed: ",
          "d2lio/rejection/tua = 2: unknown; there are d2lio/rejection/mode",
          "d2lio/degeneracy/w = -1: allowed: ", "d2lio/upstream_fixes = perhaps: allowed: true",
          "d2lio/diagnostics/csv = /no/such/folder/x.csv: allowed: a file that can be written"}) {
        EXPECT_NE(why.find(part), std::string::npos) << part << "\nin\n" << why;
    }
}

TEST(UpstreamGlue, ANamespaceThatIsAValueIsRefused) {
    Node node;
    test::set_absolute(node, "d2lio", "point_adaptive");
    EXPECT_NE(message_of(node).find("d2lio = point_adaptive: unknown"), std::string::npos);
}

TEST(UpstreamGlue, OtherPeoplesParametersAreNoneOfItsBusiness) {
    Node node;
    test::set_absolute(node, "mapping/acc_cov", 0.1);
    test::set_absolute(node, "d2liox/rejection/mode", "kis");
    EXPECT_EQ(message_of(node), "");
}

/// Neighbours on the plane z = 2 of the map.
struct Patch {
    std::vector<Point> near{5};
    std::vector<float> sq{0.01F, 0.02F, 0.04F, 0.08F, 0.09F};
    Point p;
    Patch() {
        const float xy[5][2] = {
            {0.1F, 0.F}, {-0.1F, 0.05F}, {0.F, 0.2F}, {0.2F, 0.2F}, {-0.2F, -0.2F}};
        for (std::size_t i = 0; i < 5; ++i) {
            near[i].x = xy[i][0];
            near[i].y = xy[i][1];
            near[i].z = 2.F;
        }
        p.z = 2.05F;
    }
};

TEST(UpstreamGlue, AcceptsWithPlaneAndDistanceOrRejectsAndStaysSilent) {
    Node node;
    test::set(node, "rejection/mode", "fixed");
    test::set(node, "rejection/tau", 0.5);
    UpstreamGlue glue;
    glue.configure(node, 0.5);
    ASSERT_TRUE(glue.decides());
    Filter kf;
    glue.begin_scan(1.0, kf.x, kf.P, 4);
    const Eigen::Vector3d p(3.0, 4.0, 0.0);
    const Patch patch;
    Point plane;
    EXPECT_TRUE(glue.accept(0, true, kf.x, p, patch.p, patch.near, patch.sq, plane));
    EXPECT_NEAR(std::abs(plane.z), 1.0, 1e-5);
    EXPECT_NEAR(std::abs(plane.intensity), 0.05, 1e-5);
    EXPECT_NEAR(plane.z * plane.intensity, 0.05, 1e-5);  // signed along the normal
    // Until the next search the distances mean nothing.
    EXPECT_TRUE(glue.accept(0, false, kf.x, p, patch.p, patch.near, {}, plane));

    Point untouched;
    Patch far = patch;
    far.sq[0] = 0.26F;
    EXPECT_FALSE(glue.accept(1, true, kf.x, p, far.p, far.near, far.sq, untouched));
    Patch few = patch;
    few.near.resize(4);
    EXPECT_FALSE(glue.accept(2, true, kf.x, p, few.p, few.near, few.sq, untouched));
    few.near.clear();
    EXPECT_FALSE(glue.accept(3, true, kf.x, p, few.p, few.near, few.sq, untouched));
    EXPECT_FALSE(glue.accept(99, true, kf.x, p, patch.p, patch.near, patch.sq, untouched));
    EXPECT_EQ(untouched.intensity, -7.F);
}

/// point_adaptive opens with the range of the point from the IMU, so the extrinsic counts.
TEST(UpstreamGlue, RangeIsMeasuredFromTheImu) {
    Node node;
    test::set(node, "rejection/mode", "point_adaptive");
    test::set(node, "rejection/epsilon_0", 0.0);
    UpstreamGlue glue;
    glue.configure(node, 0.5);
    Filter kf;
    State turned = kf.x;  // 0.02 rad since the last scan
    turned.rot = kf.x.rot * Eigen::Quaterniond(Eigen::AngleAxisd(0.02, Eigen::Vector3d::UnitX()));
    glue.before_prediction(kf.x);
    glue.begin_scan(1.0, turned, kf.P, 2);
    const Eigen::Vector3d p(0.0, 0.0, -0.5);  // 0 m from the IMU, 0.5 m from the LiDAR
    Patch patch;
    patch.sq[0] = 1e-6F;
    Point plane;
    EXPECT_FALSE(glue.accept(0, true, turned, p, patch.p, patch.near, patch.sq, plane));
    const Eigen::Vector3d q(0.0, 0.0, 0.5);  // 1 m from the IMU
    EXPECT_TRUE(glue.accept(1, true, turned, q, patch.p, patch.near, patch.sq, plane));
}

TEST(UpstreamGlue, AppendsRowsThatAddThePriorsInformation) {
    Node node;
    test::set(node, "degeneracy/method", "paper");
    UpstreamGlue glue;
    glue.configure(node, 0.5);
    EXPECT_FALSE(glue.decides());
    Filter kf;
    Equations eq(50, 1e-3);
    const Equations before = eq;
    glue.before_prediction(kf.x);
    glue.begin_scan(1.0, kf.x, kf.P, 400);
    State moved = kf.x;
    moved.pos.x() += 0.3;
    glue.condition(moved, kVariance, eq.H, eq.z);
    ASSERT_GT(eq.H.rows(), 50);
    ASSERT_EQ(eq.H.rows(), eq.z.size());
    EXPECT_EQ(eq.H.topRows(50), before.H);
    EXPECT_EQ(eq.z.head(50), before.z);
    const Eigen::MatrixXd rows = eq.H.bottomRows(eq.H.rows() - 50);
    EXPECT_EQ(rows.rightCols(6).norm(), 0.0);
    const Eigen::MatrixXd W = rows.transpose() * rows;
    EXPECT_NEAR(W(0, 0), kVariance * 30.0 / 1e-2, 1e-3);  // w / P, nothing of the scan's own
    EXPECT_LT(W(1, 1), 0.1 * W(0, 0));
    // Towards the prediction: -sqrt(W) e, so H^T z = -W e with e = 0.3 m along x.
    const Eigen::VectorXd pull = rows.transpose() * eq.z.tail(eq.z.size() - 50);
    EXPECT_NEAR(pull[0], -0.3 * W(0, 0), 1e-9 * W(0, 0));
}

TEST(UpstreamGlue, TheKeptCovarianceDoesNotClaimThePrior) {
    Node node;
    test::set(node, "degeneracy/method", "paper");
    UpstreamGlue glue;
    glue.configure(node, 0.5);
    Filter kf;
    Equations eq(50, 1e-3);
    glue.before_prediction(kf.x);
    glue.begin_scan(1.0, kf.x, kf.P, 400);
    const Equations scan = eq;
    glue.condition(kf.x, kVariance, eq.H, eq.z);
    const auto posterior = [&](const Equations& e) {
        Mat23 information = kf.P.inverse();
        information.topLeftCorner<12, 12>() += e.H.transpose() * e.H / kVariance;
        return Mat23(information.inverse());
    };
    const Mat23 alone = posterior(scan);
    kf.P = posterior(eq);
    glue.end_scan(kf);
    EXPECT_EQ(kf.changes, 1);
    EXPECT_LT((kf.P - alone).norm(), 1e-9 * alone.norm());
}

TEST(UpstreamGlue, RecordsEveryScanInTheFileAndOnTheTopic) {
    const std::string path = ::testing::TempDir() + "d2lio_glue_record.csv";
    Node node;
    test::set(node, "diagnostics/csv", path.c_str());
    test::set(node, "diagnostics/topic", "here");
    UpstreamGlue glue;
    glue.configure(node, 0.5);
    Filter kf;
    for (int i = 0; i < 3; ++i) {
        Equations eq(50, 1e-3);
        run_scan(glue, kf, eq, 1.6e9 + 0.1 * i);
    }
    std::ifstream in(path);
    std::string header, line;
    std::getline(in, header);
    const std::vector<std::string> names = cells(header);
    std::vector<std::vector<std::string>> rows;
    while (std::getline(in, line)) rows.push_back(cells(line));
    ASSERT_EQ(rows.size(), 3U);
    const auto at = [&](std::size_t row, const std::string& name) {
        for (std::size_t c = 0; c < names.size(); ++c) {
            if (names[c] == name) return rows[row][c];
        }
        return std::string("absent");
    };
    EXPECT_EQ(at(1, "stamp"), "1600000000.099999905");  // a double of that size
    EXPECT_EQ(at(0, "offered"), "400");
    EXPECT_EQ(at(0, "accepted"), "50");
    EXPECT_EQ(at(0, "rejected_residual"), "nan");  // upstream's gates do not tell
    EXPECT_EQ(at(0, "weak_t"), "1");
    EXPECT_EQ(at(0, "converged"), "1");
    EXPECT_EQ(at(0, "correction_t"), "0.3");

    const auto messages = test::published(node);
    ASSERT_EQ(messages.size(), 3U);
    EXPECT_EQ(messages[0].first, "here");
    const auto& status = messages[2].second.status.at(0);
    EXPECT_NEAR(test::stamp_of(messages[2].second), 1.6e9 + 0.2, 1e-6);
    EXPECT_EQ(status.level, std::remove_reference_t<decltype(status)>::WARN);
    EXPECT_EQ(status.message, "degenerate: 1 weak directions");
    EXPECT_EQ(status.values.size() + 1, names.size());
    std::remove(path.c_str());
}

TEST(UpstreamGlue, AScanWithoutCorrespondencesIsAnError) {
    Node node;
    test::set(node, "rejection/mode", "none");
    UpstreamGlue glue;
    glue.configure(node, 0.5);
    Filter kf;
    glue.before_prediction(kf.x);
    glue.begin_scan(1.0, kf.x, kf.P, 400);
    glue.end_scan(kf);
    const auto messages = test::published(node);
    ASSERT_EQ(messages.size(), 1U);
    EXPECT_EQ(messages[0].first, "d2lio/diagnostics");
    EXPECT_EQ(messages[0].second.status.at(0).message, "lost: no correspondence");
}

TEST(UpstreamGlue, CovarianceIsOfThisScanInRosOrderAndMapAxes) {
    Node node;
    test::set(node, "upstream_fixes", true);
    UpstreamGlue glue;
    glue.configure(node, 0.5);
    Filter kf;
    kf.P.setIdentity();
    for (int i = 0; i < 6; ++i) kf.P(i, i) = 1.0 + i;
    kf.P(0, 4) = kf.P(4, 0) = 0.5;
    glue.before_prediction(kf.x);
    glue.begin_scan(1.0, kf.x, kf.P, 400);
    glue.end_scan(kf);
    EXPECT_EQ(kf.changes, 0);
    std::array<double, 36> ros{};
    glue.fill_covariance(kf.P, ros);
    const Eigen::Matrix3d R = kf.x.rot.toRotationMatrix();
    Eigen::Matrix<double, 6, 6> J = Eigen::Matrix<double, 6, 6>::Identity();
    J.bottomRightCorner<3, 3>() = R;
    const Eigen::Matrix<double, 6, 6> expected = J * kf.P.topLeftCorner<6, 6>() * J.transpose();
    for (int i = 0; i < 6; ++i) {
        for (int j = 0; j < 6; ++j) {
            EXPECT_NEAR(ros[static_cast<std::size_t>(6 * i + j)], expected(i, j), kExact);
        }
    }
}

TEST(UpstreamGlue, NumbersThatAreNoneAreLeftToUpstream) {
    Node node;
    test::set(node, "rejection/mode", "point_adaptive");
    test::set(node, "degeneracy/method", "paper");
    UpstreamGlue glue;
    glue.configure(node, 0.5);
    Filter kf;
    kf.P(3, 3) = NAN;
    glue.before_prediction(kf.x);
    glue.begin_scan(1.0, kf.x, kf.P, -1);
    Equations eq(50, 1e-3);
    glue.condition(kf.x, kVariance, eq.H, eq.z);
    EXPECT_EQ(eq.H.rows(), 50);
    EXPECT_NO_THROW(glue.end_scan(kf));
}

}  // namespace
}  // namespace d2lio::fastlio
