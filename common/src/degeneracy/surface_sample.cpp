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

/// @param p from the centroids.
void find_sags(const in_plane::Bend<Four>& bend, const FourVectors& n, const FourVectors& p,
               const SurfaceSide* sides, const BendField& bends, Sag* sags) {
    const Four curves(
        sides[0].sign * bends.at(sides[0].facing), sides[1].sign * bends.at(sides[1].facing),
        sides[2].sign * bends.at(sides[2].facing), sides[3].sign * bends.at(sides[3].facing));
    const Four off = in_plane::dot(n, p);
    const Four level = bend.mean + in_plane::dot(bend.slope, p);
    const Four here = curves * (0.5F * (in_plane::dot(p, p) - off * off) - level);
    const Four x = curves * (p.x - off * n.x - bend.slope.x),
               y = curves * (p.y - off * n.y - bend.slope.y),
               z = curves * (p.z - off * n.z - bend.slope.z);
    for (int lane = 0; lane < 4; ++lane) sags[lane] = {here[lane], {x[lane], y[lane], z[lane]}};
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
    const std::size_t whole = padded(rows);
    floats_.resize(kFloats * whole);
    sides_.resize(whole);
    for (std::size_t row = rows; row < whole; ++row) leave_out(row);
}

void SurfaceSample::set(std::size_t row, const float* xyz, int stride, const PlaneMoments& moments,
                        const Eigen::Vector3f& normal, const SurfaceSide& side,
                        const Eigen::Vector3f& p) {
    float* to = floats_.data() + begin(row);
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
    float* const to = floats_.data() + begin(row);
    for (std::size_t i = 0; i < kFloats; ++i) to[kWidth * i] = 0.F;
    sides_[row] = SurfaceSide();
}

void SurfaceSample::get(std::size_t row, Patch& patch) const {
    const float* const from = floats_.data() + begin(row);
    const auto entry = [from](std::size_t i) { return from[kWidth * i]; };
    PlaneMoments moments;
    for (std::size_t i = 0; i < 6; ++i) moments.scatter[i] = entry(kScatter + i);
    std::array<float, 3 * Patch::kCount> offsets;
    for (std::size_t i = 0; i < offsets.size(); ++i) offsets[i] = entry(kOffsets + i);
    const Eigen::Vector3f normal(entry(kNormal), entry(kNormal + 1), entry(kNormal + 2));
    make_patch(offsets.data(), 3, Patch::kCount, moments, normal, sides_[row], patch);
}

SurfaceSums SurfaceSample::survey(BendField& bends, Sag* sags) const {
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
        const SurfaceSide* const sides = &sides_[row];
        for (int lane = 0; lane < 4; ++lane) {
            bends.add(sides[lane].facing, sides[lane].sign * bend.rise[lane], bend.run[lane]);
        }
        if (sags != nullptr) find_sags(bend, n, vectors(block, kPoint), sides, bends, sags + row);
    }
    SurfaceSums out;
    out.add(total(information), total(noise));
    return out;
}

}  // namespace d2lio
