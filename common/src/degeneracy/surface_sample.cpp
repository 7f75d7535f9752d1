// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/degeneracy/surface_sample.hpp"

#include "in_plane.hpp"

namespace d2lio {
namespace {

using Four = Eigen::Array4f;
using FourVectors = in_plane::Vector<Four>;
using FourUppers = in_plane::Upper<Four>;

Four entry(const float* block, std::size_t i) { return Eigen::Map<const Four>(block + 4 * i); }

FourVectors vectors(const float* block, std::size_t i) {
    return {entry(block, i), entry(block, i + 1), entry(block, i + 2)};
}

/// Those of the four that are too large.
void cap(const Four& trace, FourUppers& C) {
    for (int lane = 0; lane < 4; ++lane) {
        if (!(trace[lane] > in_plane::kMostVariance)) continue;
        in_plane::Upper<float> one;
        for (std::size_t i = 0; i < 6; ++i) one[i] = C[i][lane];
        one = in_plane::capped(one);
        for (std::size_t i = 0; i < 6; ++i) C[i][lane] = one[i];
    }
}

/// A row that is left out has no normal, and no covariance.
FourUppers covariances(const in_plane::Scatter<Four>& plane, const FourVectors& n) {
    const Four present = in_plane::dot(n, n);
    const Four variance = (present > 0.5F).select(in_plane::variance_of(plane), 0.F);
    FourUppers C;
    for (std::size_t i = 0; i < 6; ++i) C[i] = variance * plane.inverse[i];
    const Four trace = C[0] + C[3] + C[5];
    if ((trace > in_plane::kMostVariance).any()) cap(trace, C);
    return C;
}

void add(const FourUppers& more, FourUppers& sum) {
    for (std::size_t i = 0; i < 6; ++i) sum[i] += more[i];
}

in_plane::Upper<float> total(const FourUppers& sum) {
    in_plane::Upper<float> out;
    for (std::size_t i = 0; i < 6; ++i) out[i] = sum[i].sum();
    return out;
}

}  // namespace

void SurfaceSample::resize(std::size_t rows) {
    const std::size_t whole = (rows + kWidth - 1) / kWidth * kWidth;
    floats_.resize(kFloats * whole);
    sides_.resize(whole);
    for (std::size_t row = rows; row < whole; ++row) leave_out(row);
}

void SurfaceSample::set(std::size_t row, const float* xyz, int stride, const PlaneMoments& moments,
                        const Eigen::Vector3f& normal, const SurfaceSide& side,
                        const Eigen::Vector3f& p) {
    float* to = begin(row);
    const auto put = [&to](float v) {
        *to = v;
        to += kWidth;
    };
    const Eigen::Vector3f& c = moments.centroid;
    for (int k = 0; k < 3; ++k) put(normal[k]);
    for (const float entry : moments.scatter) put(entry);
    for (int i = 0; i < Patch::kCount; ++i) {
        for (int k = 0; k < 3; ++k) put(xyz[i * stride + k] - c[k]);
    }
    for (int k = 0; k < 3; ++k) put(p[k] - c[k]);
    sides_[row] = side;
}

void SurfaceSample::leave_out(std::size_t row) {
    float* const to = begin(row);
    for (std::size_t i = 0; i < kFloats; ++i) to[kWidth * i] = 0.F;
    sides_[row] = SurfaceSide();
}

SurfaceSums SurfaceSample::survey(BendField& bends) const {
    FourUppers information, noise;
    information.fill(Four::Zero());
    noise.fill(Four::Zero());
    for (std::size_t row = 0; row < sides_.size(); row += kWidth) {
        const float* const block = floats_.data() + row * kFloats;
        const FourVectors n = vectors(block, kNormal);
        FourUppers S;
        for (std::size_t i = 0; i < 6; ++i) S[i] = entry(block, kScatter + i);
        std::array<FourVectors, Patch::kCount> offsets;
        for (std::size_t i = 0; i < offsets.size(); ++i) {
            offsets[i] = vectors(block, kOffsets + 3 * i);
        }
        const FourVectors Sn = in_plane::multiply(S, n);
        const in_plane::Scatter<Four> plane = in_plane::scatter_of(S, n, Sn);
        add({n.x * n.x, n.x * n.y, n.x * n.z, n.y * n.y, n.y * n.z, n.z * n.z}, information);
        add(covariances(plane, n), noise);
        const in_plane::Bend<Four> bend = in_plane::bend_of(offsets, plane.inverse, n, Sn);
        const Four level = bend.mean + in_plane::dot(bend.slope, vectors(block, kPoint));
        for (std::size_t lane = 0; lane < kWidth; ++lane) {
            const auto at = static_cast<Eigen::Index>(lane);
            const SurfaceSide& side = sides_[row + lane];
            bends.add({side.sign * bend.rise[at], bend.run[at], level[at],
                       2.F * Patch::kCount * bend.mean[at], side.facing});
        }
    }
    SurfaceSums out;
    out.add(total(information), total(noise));
    return out;
}

}  // namespace d2lio
