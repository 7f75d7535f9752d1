// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <vector>

#include "../geometry/random_state.hpp"
#include "d2lio/degeneracy/localizability.hpp"

namespace d2lio {
namespace {

constexpr double kExact = 1e-12;
constexpr double kDegree = 3.14159265358979 / 180.0;

using Row = Eigen::Matrix<double, 6, 1>;

/// Rotation part first.
struct Rows {
    std::vector<Row> rows;
    void add(const Vec3& torque, const Vec3& normal, int times = 1) {
        Row row;
        row << torque, normal;
        for (int i = 0; i < times; ++i) rows.push_back(row);
    }
    RowView view() const {
        const int count = static_cast<int>(rows.size());
        return {{rows[0].data(), count, 6, 1}, {rows[0].data() + 3, count, 6, 1}};
    }
};

/// At this angle from x, in the plane of x and y.
Vec3 leaning(double degrees) {
    return {std::cos(degrees * kDegree), std::sin(degrees * kDegree), 0.0};
}

TEST(Contributions, CountComponentsAboveEightyAndFortyFiveDegrees) {
    Rows rows;
    for (const double degrees : {30.0, 44.0, 46.0, 79.0, 81.0}) {
        rows.add(Vec3::Zero(), -leaning(degrees));  // the sign is of no account
    }
    const Contributions c = contributions(rows.view().translation, Mat3::Identity());
    const auto sum = [](std::initializer_list<double> angles) {
        double out = 0.0;
        for (const double a : angles) out += std::cos(a * kDegree);
        return out;
    };
    EXPECT_NEAR(c.filtered[0], sum({30.0, 44.0, 46.0, 79.0}), kExact);
    EXPECT_NEAR(c.strong[0], sum({30.0, 44.0}), kExact);
    EXPECT_NEAR(c.filtered[1], sum({60.0, 46.0, 44.0, 11.0, 9.0}), kExact);
    EXPECT_NEAR(c.strong[1], sum({44.0, 11.0, 9.0}), kExact);
    EXPECT_EQ(c.filtered[2], 0.0);
}

TEST(Contributions, LongTorquesCountAsOneAndShortOnesAsTheyAre) {
    Rows rows;
    rows.add(20.0 * leaning(60.0), Vec3::UnitZ());
    rows.add(0.5 * leaning(0.0), Vec3::UnitZ());
    const Contributions c = contributions(rows.view().rotation, Mat3::Identity());
    EXPECT_NEAR(c.filtered[0], 0.5 + 0.5, kExact);
    EXPECT_NEAR(c.strong[0], 0.0, kExact);
}

TEST(Contributions, StepsAndDirectionsMayBeAny) {
    test::Random random(1);
    const Mat3 V = random.rotation();
    Rows rows;
    for (int i = 0; i < 50; ++i) rows.add(random.vec3(2.0), random.vec3(1.0).normalized());
    std::vector<double> columns(6 * rows.rows.size());
    for (std::size_t i = 0; i < rows.rows.size(); ++i) {
        for (std::size_t k = 0; k < 6; ++k) {
            columns[k * rows.rows.size() + i] = rows.rows[i][static_cast<Eigen::Index>(k)];
        }
    }
    const int n = static_cast<int>(rows.rows.size());
    const Contributions a = contributions(rows.view().translation, V);
    const Contributions b = contributions({columns.data() + 3 * n, n, 1, n}, V);
    EXPECT_EQ(a.filtered, b.filtered);
    EXPECT_EQ(a.strong, b.strong);
    EXPECT_GT(a.strong.minCoeff(), 0.0);
}

/// Walls all around x, torques in all directions, and what `extra` adds.
PriorTerm in_tunnel(const std::function<void(Rows&)>& extra) {
    test::Random random(2);
    Rows rows;
    for (int i = 0; i < 1000; ++i) {
        const double angle = random.uniform(0.0, 6.28);
        rows.add(random.vec3(3.0), {0.0, std::cos(angle), std::sin(angle)});
    }
    extra(rows);
    return XIcpPrior{}.evaluate(Spectrum{}, rows.view());
}

TEST(XIcpPrior, KeepsThePredictionWhereTooFewContribute) {
    const PriorTerm bare = in_tunnel([](Rows&) {});
    EXPECT_TRUE(bare.projects);
    EXPECT_FALSE(bare.adds_prior);
    EXPECT_LT((bare.keep_t - Vec3(0.0, 1.0, 1.0).asDiagonal().toDenseMatrix()).norm(), kExact);
    EXPECT_LT((bare.keep_r - Mat3::Identity()).norm(), kExact);
}

TEST(XIcpPrior, EitherKindOfContributionIsEnough) {
    const auto projects = [](double degrees, int times) {
        const auto add = [&](Rows& rows) { rows.add(Vec3::UnitX(), leaning(degrees), times); };
        return in_tunnel(add).projects;
    };
    EXPECT_TRUE(projects(0.0, 34));
    EXPECT_FALSE(projects(0.0, 35));  // strong
    EXPECT_TRUE(projects(60.0, 359));
    EXPECT_FALSE(projects(60.0, 361));  // half of each counts
    EXPECT_TRUE(projects(81.0, 5000));  // not worth counting
}

TEST(XIcpPrior, WithoutRowsEverythingIsLeftToThePrediction) {
    const RowView none{{nullptr, 0, 6, 1}, {nullptr, 0, 6, 1}};
    const PriorTerm t = XIcpPrior{}.evaluate(Spectrum{}, none);
    EXPECT_TRUE(t.projects);
    EXPECT_EQ(t.keep_t, Mat3::Zero());
    EXPECT_EQ(t.keep_r, Mat3::Zero());
}

TEST(TruncatedPrior, CutsByTheRatioToTheBlocksLargestSingularValue) {
    test::Random random(3);
    Spectrum s;
    s.translation.v = random.rotation();
    s.translation.lambda = Vec3(9.0, 11.0, 1000.0);  // a hundredth is 10
    s.rotation.lambda = Vec3(1.0, 1.0, 99.0);
    for (const double points : {1.0, 50.0}) {  // however many there are
        Spectrum scaled = s;
        scaled.translation.lambda *= points;
        const PriorTerm t = TruncatedPrior{}.evaluate(scaled, Mat3::Identity(), Mat3::Identity());
        EXPECT_TRUE(t.projects);
        EXPECT_LT((t.keep_t * s.translation.v.col(0)).norm(), kExact);
        const Vec3 kept = s.translation.v.col(1);
        EXPECT_LT((t.keep_t * kept - kept).norm(), kExact);
        EXPECT_LT((t.keep_r - Mat3::Identity()).norm(), kExact);
    }
    s.translation.lambda[0] = 10.1;
    EXPECT_FALSE(TruncatedPrior{}.evaluate(s, Mat3::Identity(), Mat3::Identity()).projects);
}

TEST(TruncatedPrior, ABlockOfZerosIsLeftAlone) {
    EXPECT_FALSE(TruncatedPrior{}.evaluate({}, Mat3::Identity(), Mat3::Identity()).projects);
}

}  // namespace
}  // namespace d2lio
