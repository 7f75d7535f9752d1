// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "d2lio/degeneracy/spectrum.hpp"

/// Policies of the degeneracy slot, one struct each. A policy sees the spectrum of the accepted
/// correspondences and the covariance blocks of the predicted pose, and answers with a PriorTerm.
namespace d2lio {

/// What a policy adds to or takes from one scan's least squares.
struct PriorTerm {
    /// Information (inverse covariance) of the prior on the deviation from the predicted pose,
    /// positive semi-definite; zero where the policy adds nothing.
    Mat3 W_r = Mat3::Zero();  ///< rad^-2
    Mat3 W_t = Mat3::Zero();  ///< m^-2
    /// Projectors applied to the Jacobian's blocks: directions in their null space get nothing from
    /// the scan.
    Mat3 keep_r = Mat3::Identity();
    Mat3 keep_t = Mat3::Identity();
    bool adds_prior = false;
    bool projects = false;
};

/// No degeneracy handling.
struct NoPrior {
    PriorTerm evaluate(const Spectrum&, const Mat3& /*P_r*/, const Mat3& /*P_t*/) const {
        return {};
    }
};

/// The paper's directional prior, section III-E.2: w (|e_r|^2_Wr + |e_t|^2_Wt) with
/// W = (A^T A P)^-1 for each block. (The paper prints W_r under both terms, a misprint.)
struct PaperPrior {
    enum class Form {
        kCongruence,  ///< P^-1/2 (A^T A)^-1 P^-1/2: symmetric positive definite
        kPaper,       ///< symmetric part of (A^T A P)^-1, negative eigenvalues clipped to 0
    };
    Form form = Form::kCongruence;
    double w = 30.0;
    double lambda_min = 1.0;  ///< eigenvalues of A^T A are raised to this

    PriorTerm evaluate(const Spectrum& spectrum, const Mat3& P_r, const Mat3& P_t) const;
};

/// Solution remapping: directions with an eigenvalue below the threshold keep the prediction
/// (Zhang, Kaess, Singh, "On degeneracy of optimization-based state estimation problems", 2016). In
/// a filter the scan's rows lose their component along such a direction, and the prediction is
/// held there.
struct RemapPrior {
    double threshold_r = 100.0;  ///< m^2
    double threshold_t = 100.0;  ///< points

    PriorTerm evaluate(const Spectrum& spectrum, const Mat3& P_r, const Mat3& P_t) const;
};

/// Truncated singular value decomposition of the Jacobian's blocks: directions whose singular value
/// is below the block's largest by more than `condition` keep the prediction (Hansen, "The
/// truncated SVD as a method for regularization", 1987; in point cloud registration: Tuna et al.,
/// "Informed, constrained, aligned", 2024). Unlike RemapPrior's threshold it does not depend on how
/// many points there are.
struct TruncatedPrior {
    double condition = 10.0;  ///< largest ratio of singular values that is kept

    PriorTerm evaluate(const Spectrum& spectrum, const Mat3& P_r, const Mat3& P_t) const;
};

}  // namespace d2lio
