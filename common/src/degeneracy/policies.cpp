// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/degeneracy/policies.hpp"

#include <algorithm>
#include <cmath>

namespace d2lio {
namespace {

/// Smallest variance used of a predicted pose: keeps inverses finite when P is singular.
constexpr double kMinVariance = 1e-12;

double inverse_root(double x) { return 1.0 / std::sqrt(std::max(x, kMinVariance)); }
double inverse(double x) { return 1.0 / std::max(x, kMinVariance); }

Mat3 congruence_weight(const BlockSpectrum& s, const Mat3& P, double lambda_min) {
    const Mat3 root = decompose(P).apply(inverse_root);
    const Mat3 inverse_information =
        s.apply([lambda_min](double l) { return 1.0 / std::max(l, lambda_min); });
    return root * inverse_information * root;
}

Mat3 literal_weight(const BlockSpectrum& s, const Mat3& P, double lambda_min) {
    const Mat3 inverse_information =
        s.apply([lambda_min](double l) { return 1.0 / std::max(l, lambda_min); });
    const Mat3 W = decompose(P).apply(inverse) * inverse_information;  // (A^T A P)^-1
    return decompose(0.5 * (W + W.transpose())).apply([](double l) { return std::max(l, 0.0); });
}

Mat3 well_conditioned_projector(const BlockSpectrum& s, double threshold) {
    return s.apply([threshold](double l) { return l < threshold ? 0.0 : 1.0; });
}

}  // namespace

PriorTerm PaperPrior::evaluate(const Spectrum& s, const Mat3& P_r, const Mat3& P_t) const {
    const auto weight = form == Form::kCongruence ? congruence_weight : literal_weight;
    PriorTerm out;
    out.W_r = w * weight(s.rotation, P_r, lambda_min);
    out.W_t = w * weight(s.translation, P_t, lambda_min);
    out.adds_prior = w > 0.0;
    return out;
}

PriorTerm RemapPrior::evaluate(const Spectrum& s, const Mat3& /*P_r*/, const Mat3& /*P_t*/) const {
    PriorTerm out;
    out.keep_r = well_conditioned_projector(s.rotation, threshold_r);
    out.keep_t = well_conditioned_projector(s.translation, threshold_t);
    out.projects = s.rotation.lambda[0] < threshold_r || s.translation.lambda[0] < threshold_t;
    return out;
}

PriorTerm TruncatedPrior::evaluate(const Spectrum& s, const Mat3& /*P_r*/,
                                   const Mat3& /*P_t*/) const {
    const auto least = [this](const BlockSpectrum& b) {  // eigenvalues are squared singular values
        return b.lambda[2] / (condition * condition);
    };
    PriorTerm out;
    out.keep_r = well_conditioned_projector(s.rotation, least(s.rotation));
    out.keep_t = well_conditioned_projector(s.translation, least(s.translation));
    out.projects =
        s.rotation.lambda[0] < least(s.rotation) || s.translation.lambda[0] < least(s.translation);
    return out;
}

}  // namespace d2lio
