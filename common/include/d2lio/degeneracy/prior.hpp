// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <variant>

#include "d2lio/config/params.hpp"
#include "d2lio/degeneracy/blind.hpp"
#include "d2lio/degeneracy/localizability.hpp"
#include "d2lio/degeneracy/policies.hpp"

namespace d2lio {

enum class DegeneracyMethod { kNone, kPaper, kRemap, kTruncatedSvd, kXIcp, kNoiseAware };

struct DegeneracyConfig {
    DegeneracyMethod method = DegeneracyMethod::kNone;
    PaperPrior::Form form = PaperPrior::Form::kCongruence;
    double w = 30.0;             ///< method paper
    double lambda_min = 1.0;     ///< points and m^2, method paper
    bool inflate_only = true;    ///< the kept covariance leaves the prior's rows out
    double threshold_r = 100.0;  ///< m^2, method remap
    double threshold_t = 100.0;  ///< points, method remap
    double condition = 10.0;     ///< method tsvd
    double kappa_2 = 180.0;      ///< method xicp
    double kappa_3 = 35.0;       ///< method xicp
    double weak_share = 0.03;    ///< of the trace; smaller eigenvalues are reported as weak
    NoiseAwareConfig noise_aware;
    bool rest = true;  ///< method noise_aware: hold the pose until the first motion

    bool cleans_rows() const { return method == DegeneracyMethod::kNoiseAware; }
    bool counts_rows() const { return method == DegeneracyMethod::kXIcp; }

    /// Binds the keys `degeneracy.*`.
    void bind(ParamTable& table);
    /// @throws ConfigError where parameters do not fit together.
    void validate() const;
};

/// The policy chosen by a DegeneracyConfig.
class DirectionalPrior {
  public:
    explicit DirectionalPrior(const DegeneracyConfig& config);

    bool active() const { return !std::holds_alternative<NoPrior>(policy_); }
    /// @param P_r, P_t covariance blocks of the predicted pose (rad^2, body; m^2, map).
    /// @param rows behind the spectrum; method xicp does nothing without them.
    PriorTerm evaluate(const Spectrum& spectrum, const Mat3& P_r, const Mat3& P_t,
                       const RowView* rows = nullptr) const;

  private:
    std::variant<NoPrior, PaperPrior, RemapPrior, TruncatedPrior, XIcpPrior> policy_;
};

/// Up to six pseudo-measurement rows that carry a prior into a filter or a least squares: their
/// normal equations are J^T W J with J = blkdiag(J_r^-1(e_r), I).
struct PriorRows {
    int count = 0;
    Eigen::Matrix<double, 6, 3> rotation = Eigen::Matrix<double, 6, 3>::Zero();
    Eigen::Matrix<double, 6, 3> translation = Eigen::Matrix<double, 6, 3>::Zero();
    Eigen::Matrix<double, 6, 1> residual =
        Eigen::Matrix<double, 6, 1>::Zero();  ///< minus the error
};

/// Rows sqrt(w_i) v_i^T J with residual -sqrt(w_i) v_i^T e, w_i, v_i the eigenpairs of
/// variance * W. Directions without weight give no row.
/// @param e_r Log(R_pred^T R), rad; @param e_t t - t_pred, m.
/// @param variance measurement variance that the other rows carry implicitly (FAST-LIO2: 0.001
/// m^2).
PriorRows make_prior_rows(const PriorTerm& prior, const Vec3& e_r, const Vec3& e_t,
                          double variance);

}  // namespace d2lio
