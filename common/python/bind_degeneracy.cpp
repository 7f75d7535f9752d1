// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/stl/tuple.h>

#include "arrays.hpp"
#include "d2lio/degeneracy/prior.hpp"
#include "modules.hpp"
#include "params_from_dict.hpp"

namespace d2lio::python {
namespace {

using namespace nb::literals;

Mat3 gram(const Vectors& rows) {
    const Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>> A(
        rows.data(), static_cast<Eigen::Index>(rows.shape(0)), 3);
    return A.transpose() * A;
}

}  // namespace

void bind_degeneracy(nb::module_& m) {
    m.def(
        "analyse",
        [](const Vectors& A_r, const Vectors& A_t) {
            const BlockSpectrum r = decompose(gram(A_r)), t = decompose(gram(A_t));
            nb::dict out;
            out["lambda_r"] = to_numpy(r.lambda);
            out["v_r"] = to_numpy(r.v);
            out["lambda_t"] = to_numpy(t.lambda);
            out["v_t"] = to_numpy(t.v);
            return out;
        },
        "A_r"_a, "A_t"_a,
        "Eigenvalues (ascending) and eigenvectors (columns) of A_r^T A_r and A_t^T A_t for float64 "
        "[N, 3] Jacobian blocks.");
    m.def(
        "prior",
        [](const std::map<std::string, std::string>& params, const Matrix3& information_r,
           const Matrix3& information_t, const Matrix3& P_r, const Matrix3& P_t) {
            const DirectionalPrior policy(configured<DegeneracyConfig>(params));
            const Spectrum s{decompose(to_mat3(information_r)), decompose(to_mat3(information_t))};
            const PriorTerm term = policy.evaluate(s, to_mat3(P_r), to_mat3(P_t));
            nb::dict out;
            out["W_r"] = to_numpy(term.W_r);
            out["W_t"] = to_numpy(term.W_t);
            out["keep_r"] = to_numpy(term.keep_r);
            out["keep_t"] = to_numpy(term.keep_t);
            return out;
        },
        "params"_a, "information_r"_a, "information_t"_a, "P_r"_a, "P_t"_a,
        "Prior of a degeneracy method (keys degeneracy.*): weights W (rad^-2, m^-2) and projectors "
        "keep, each float64 [3, 3]; information is A^T A per block, P the prediction's "
        "covariance.");
}

}  // namespace d2lio::python
