// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "ieskf.hpp"
#include "random_state.hpp"

namespace d2lio::fastlio {
namespace {

constexpr double kExact = 1e-9;

/// Linear measurement of the pose error around a truth: h(x) = A (x [-] truth), first 12 states.
class LinearMeasure {
  public:
    LinearMeasure(test::Random& random, Eigen::Index rows, const NavState& truth) : truth_(truth) {
        A_ = Eigen::MatrixXd::NullaryExpr(rows, 12, [&] { return random.normal(); });
    }
    bool operator()(const NavState& x, bool, Linearisation& out) const {
        const Vec23 e = state_minus(x, truth_);
        Eigen::Matrix<double, 12, 12> J = Eigen::Matrix<double, 12, 12>::Identity();
        J.block<3, 3>(3, 3) = right_jacobian_inverse_so3(e.segment<3>(3));
        J.block<3, 3>(6, 6) = right_jacobian_inverse_so3(e.segment<3>(6));
        out.reserve(A_.rows());
        out.rows = A_.rows();
        out.H.topRows(out.rows) = A_ * J;
        out.residual.head(out.rows) = -A_ * e.head<12>();
        return true;
    }

  private:
    NavState truth_;
    Eigen::MatrixXd A_;
};

IeskfOptions options(int iterations = 8) {
    IeskfOptions o;
    o.max_iteration = iterations;
    o.exact_jacobians = true;
    return o;
}

TEST(Ieskf, ManyExactRowsRecoverTheTruth) {
    test::Random random(1);
    const NavState truth = random.state();
    NavState x = state_plus(truth, 0.1 * random.vector(23, 1.0));
    Mat23x23 P = random.covariance();
    Ieskf filter(options(20));
    const auto report = filter.update(x, P, LinearMeasure(random, 400, truth));
    EXPECT_EQ(report.status, UpdateStatus::kOk);
    EXPECT_TRUE(report.converged);
    EXPECT_LT((state_minus(x, truth).head<12>().norm()), 1e-3);
}

TEST(Ieskf, PosteriorCovarianceIsTheInformationForm) {
    test::Random random(2);
    const NavState truth = random.state();
    NavState x = truth;  // prediction is right: the error stays zero and nothing is transported
    Mat23x23 P = random.covariance();
    const Mat23x23 prior = P;
    const LinearMeasure measure(random, 60, truth);
    Linearisation rows;
    measure(x, true, rows);
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(60, 23);
    H.leftCols<12>() = rows.H;
    const Mat23x23 expected = (prior.inverse() + H.transpose() * H / options().variance).inverse();
    Ieskf(options()).update(x, P, measure);
    EXPECT_LT((P - expected).norm(), kExact * expected.norm() * 100.0);
    EXPECT_EQ((P - P.transpose()).norm(), 0.0);
}

TEST(Ieskf, BothGainFormsAgree) {
    // 22 rows take the wide form; a zero row more carries nothing but takes the tall one.
    test::Random random(3);
    const NavState truth = random.state();
    const NavState start = state_plus(truth, 0.05 * random.vector(23, 1.0));
    const Mat23x23 prior = random.covariance();
    const LinearMeasure measure(random, 22, truth);
    const auto padded = [&](const NavState& x, bool search, Linearisation& out) {
        measure(x, search, out);
        out.reserve(23);
        out.H.row(22).setZero();
        out.residual[22] = 0.0;
        out.rows = 23;
        return true;
    };
    NavState a = start, b = start;
    Mat23x23 Pa = prior, Pb = prior;
    Ieskf(options()).update(a, Pa, measure);
    Ieskf(options()).update(b, Pb, padded);
    EXPECT_LT(state_minus(a, b).norm(), kExact);
    EXPECT_LT((Pa - Pb).norm(), kExact * Pa.norm());
}

TEST(Ieskf, FewerMeasurementsThanStatesStillUpdate) {
    test::Random random(4);
    const NavState truth = random.state();
    NavState x = state_plus(truth, 0.1 * random.vector(23, 1.0));
    Mat23x23 P = random.covariance();
    const double before = P.trace();
    const auto report = Ieskf(options()).update(x, P, LinearMeasure(random, 1, truth));
    EXPECT_EQ(report.status, UpdateStatus::kOk);
    EXPECT_LT(P.trace(), before);
}

TEST(Ieskf, NothingMeasuredKeepsThePrediction) {
    test::Random random(5);
    NavState x = random.state();
    const NavState before = x;
    Mat23x23 P = random.covariance();
    const Mat23x23 P_before = P;
    const auto report =
        Ieskf(options()).update(x, P, [](const NavState&, bool, Linearisation&) { return false; });
    EXPECT_EQ(report.status, UpdateStatus::kNoMeasurement);
    EXPECT_EQ(state_minus(x, before).norm(), 0.0);
    EXPECT_EQ(P, P_before);
}

TEST(Ieskf, NonFiniteRowsAndIndefinitePriorsAreRefused) {
    test::Random random(6);
    const NavState truth = random.state();
    const LinearMeasure measure(random, 50, truth);
    const auto poisoned = [&](const NavState& x, bool search, Linearisation& out) {
        measure(x, search, out);
        out.residual[7] = std::numeric_limits<double>::quiet_NaN();
        return true;
    };
    NavState x = truth;
    Mat23x23 P = random.covariance();
    const Mat23x23 P_before = P;
    EXPECT_EQ(Ieskf(options()).update(x, P, poisoned).status, UpdateStatus::kNumericalFailure);
    EXPECT_EQ(state_minus(x, truth).norm(), 0.0);
    EXPECT_EQ(P, P_before);
    P(4, 4) = -1.0;
    EXPECT_EQ(Ieskf(options()).update(x, P, measure).status, UpdateStatus::kNumericalFailure);
    EXPECT_TRUE(x.is_finite());
}

/// A pose that has moved less than the limit is not searched at twice; one that has, is.
TEST(Ieskf, SearchesOnceWhereThePoseStays) {
    test::Random random(7);
    for (const double size : {1e-4, 2e-2}) {
        IeskfOptions once = options();
        once.searches_once = true;
        std::vector<bool> searches;
        NavState x;
        const NavState truth = state_plus(x, Vec23::Constant(size));
        Mat23x23 P = Mat23x23::Identity();
        const LinearMeasure measure(random, 200, truth);
        const auto counted = [&](const NavState& s, bool search, Linearisation& out) {
            searches.push_back(search);
            return measure(s, search, out);
        };
        const UpdateReport report = Ieskf(once).update(x, P, counted);
        EXPECT_TRUE(report.converged);
        EXPECT_EQ(std::count(searches.begin(), searches.end(), true), size < 1e-3 ? 1 : 2);
        EXPECT_LT((x.pos - truth.pos).norm(), 0.1 * size);
    }
}

TEST(Ieskf, SearchesAgainOnlyAfterASmallStepAndOnTheLastPass) {
    test::Random random(7);
    const NavState truth = random.state();
    NavState x = state_plus(truth, 0.3 * random.vector(23, 1.0));
    Mat23x23 P = random.covariance();
    std::vector<bool> searches;
    int pass = 0;
    const auto restless = [&](const NavState& s, bool search, Linearisation& out) {
        searches.push_back(search);
        LinearMeasure(random, 100, state_plus(truth, Vec23::Constant(0.05 * ++pass)))(s, search,
                                                                                      out);
        return true;
    };
    Ieskf(options(3)).update(x, P, restless);
    EXPECT_EQ(searches, (std::vector<bool>{true, false, false, true}));
}

}  // namespace
}  // namespace d2lio::fastlio
