// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/degeneracy/prior.hpp"

#include <cmath>
#include <type_traits>

#include "d2lio/geometry/so3.hpp"

namespace d2lio {
namespace {

/// Share of a weight's largest eigenvalue below which another one is zero.
constexpr double kRounding = 1e-14;

std::variant<NoPrior, PaperPrior, RemapPrior, TruncatedPrior, XIcpPrior> make_policy(
    const DegeneracyConfig& c) {
    switch (c.method) {
        case DegeneracyMethod::kPaper:
            return PaperPrior{c.form, c.w, c.lambda_min};
        case DegeneracyMethod::kRemap:
            return RemapPrior{c.threshold_r, c.threshold_t};
        case DegeneracyMethod::kTruncatedSvd:
            return TruncatedPrior{c.condition};
        case DegeneracyMethod::kXIcp:
            return XIcpPrior{c.kappa_2, c.kappa_3};
        case DegeneracyMethod::kNoiseAware:  // acts on the rows, not by a prior
        case DegeneracyMethod::kNone:
            break;
    }
    return NoPrior{};
}

}  // namespace

void DegeneracyConfig::bind(ParamTable& table) {
    table.add("degeneracy.method", method,
              {"none", "paper", "remap", "tsvd", "xicp", "noise_aware"},
              "what is done where the scan cannot see");
    table.add("degeneracy.form", form, {"congruence", "paper"},
              "weight of method paper: symmetric congruence or the literal product");
    table.add("degeneracy.w", w, {0.0, 1e9}, "", "strength of method paper");
    table.add("degeneracy.lambda_min", lambda_min, {1e-9, 1e9}, "points or m^2",
              "eigenvalues are raised to this (method paper)");
    table.add("degeneracy.inflate_only", inflate_only,
              "the kept covariance does not claim the prior a second time");
    table.add("degeneracy.threshold_r", threshold_r, {0.0, 1e9}, "m^2",
              "rotation eigenvalue below which method remap keeps the prediction");
    table.add("degeneracy.threshold_t", threshold_t, {0.0, 1e9}, "points",
              "translation eigenvalue below which method remap keeps the prediction");
    table.add("degeneracy.condition", condition, {1.0, 1e9}, "",
              "ratio of a block's singular values above which method tsvd keeps the prediction");
    table.add("degeneracy.kappa_2", kappa_2, {0.0, 1e9}, "points",
              "contributions to a direction above cos 80 deg below which method xicp keeps the "
              "prediction, unless kappa_3 is reached");
    table.add("degeneracy.kappa_3", kappa_3, {0.0, 1e9}, "points",
              "contributions above cos 45 deg below which method xicp keeps the prediction, unless "
              "kappa_2 is reached");
    table.add(
        "degeneracy.share_low", noise_aware.share_low, {0.0, 1e3}, "",
        "share of a direction's information that may be noise before method noise_aware acts");
    table.add("degeneracy.share_high", noise_aware.share_high, {1e-6, 1e3}, "",
              "share from which on method noise_aware acts fully; above share_low");
    table.add("degeneracy.significance", noise_aware.significance, {0.0, 1e3}, "sigma",
              "by which a normal's component along such a direction must exceed its own noise");
    table.add(
        "degeneracy.rest", rest,
        "method noise_aware: once a second of IMU and scans has shown rest at the start, hold the "
        "pose and learn the IMU's noise until the first motion");
    table.add("degeneracy.weak_share", weak_share, {0.0, 1.0 / 3.0}, "",
              "a direction whose eigenvalue is below this share of the trace is reported as weak");
}

void DegeneracyConfig::validate() const {
    const auto text = [](double v) { return std::to_string(v); };
    if (!(noise_aware.share_high > noise_aware.share_low)) {
        throw ConfigError("degeneracy.share_high", text(noise_aware.share_high),
                          "above degeneracy.share_low (" + text(noise_aware.share_low) + ")");
    }
}

DirectionalPrior::DirectionalPrior(const DegeneracyConfig& config) : policy_(make_policy(config)) {}

PriorTerm DirectionalPrior::evaluate(const Spectrum& spectrum, const Mat3& P_r, const Mat3& P_t,
                                     const RowView* rows) const {
    return std::visit(
        [&](const auto& p) -> PriorTerm {
            if constexpr (std::is_same_v<std::decay_t<decltype(p)>, XIcpPrior>) {
                return rows != nullptr ? p.evaluate(spectrum, *rows) : PriorTerm{};
            } else {
                return p.evaluate(spectrum, P_r, P_t);
            }
        },
        policy_);
}

PriorRows make_prior_rows(const PriorTerm& prior, const Vec3& e_r, const Vec3& e_t,
                          double variance) {
    PriorRows rows;
    const auto append = [&rows, variance](const Mat3& W, const Mat3& J, const Vec3& e,
                                          auto& block) {
        const BlockSpectrum s = decompose(W);
        for (int i = 0; i < 3; ++i) {
            const double root = std::sqrt(variance * s.lambda[i]);
            if (!(s.lambda[i] > kRounding * s.lambda[2]) || !std::isfinite(root)) continue;
            block.row(rows.count) = root * s.v.col(i).transpose() * J;
            rows.residual[rows.count] = -root * s.v.col(i).dot(e);
            ++rows.count;
        }
    };
    append(prior.W_r, right_jacobian_inverse_so3(e_r), e_r, rows.rotation);
    append(prior.W_t, Mat3::Identity(), e_t, rows.translation);
    return rows;
}

}  // namespace d2lio
