// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/plugin/plugin.hpp"

#include <cmath>

#include "d2lio/geometry/so3.hpp"
#include "d2lio/plugin/core.hpp"

namespace d2lio {

Pose to_pose(const PoseView& v) {
    return {Eigen::Map<const Mat3>(v.rotation), Eigen::Map<const Vec3>(v.position)};
}

Plugin::Core::Core() {
    rejection.bind(table);
    degeneracy.bind(table);
    docs = table.describe();
}

void Plugin::Core::rebuild() {
    rejector = Rejector(rejection, map_voxel);
    prior = DirectionalPrior(degeneracy);
}

Status Plugin::Core::begin(bool usable, const Pose& previous) {
    current = ScanDiagnostics{};
    blind_before = blind_now;
    blind_now = BlindDirections{};
    in_scan =
        usable && is_finite(predicted) && is_finite(previous) && P_r.allFinite() && P_t.allFinite();
    if (!in_scan) return Status::kBadInput;
    rejector.begin_scan(previous.inverse() * predicted);
    current.sigma = rejector.sigma();
    return Status::kOk;
}

PriorTerm Plugin::Core::analyse(const Mat3& AtA_r, const Mat3& AtA_t, const RowView* rows) {
    ++current.iterations;
    const Spectrum spectrum{decompose(AtA_r), decompose(AtA_t)};
    const PriorTerm term = prior.evaluate(spectrum, P_r, P_t, rows);
    keep_spectrum(spectrum, term);
    return term;
}

BlindDirections Plugin::Core::find_blind(const SurfaceSums& sums) {
    const NoiseShare share = noise_share(sums.information(), sums.noise());
    current.noise_share = share.share;
    current.noise_axes = share.axes;
    BlindDirections blind = d2lio::find_blind(share, P_t, degeneracy.noise_aware);
    stay_blind(blind_before, blind);
    blind_now = blind;
    current.blind = blind.count;
    return blind;
}

void Plugin::Core::forget_blind() {
    blind_now = BlindDirections{};
    current.blind = 0;
}

void Plugin::Core::keep_spectrum(const Spectrum& s, const PriorTerm& term) {
    current.lambda_r = s.rotation.lambda;
    current.lambda_t = s.translation.lambda;
    current.v_r = s.rotation.v;
    current.v_t = s.translation.v;
    current.weak_r = s.rotation.weak_count(degeneracy.weak_share);
    current.weak_t = s.translation.weak_count(degeneracy.weak_share);
    for (int i = 0; i < 3; ++i) {
        current.prior_r[i] = s.rotation.v.col(i).dot(term.W_r * s.rotation.v.col(i));
        current.prior_t[i] = s.translation.v.col(i).dot(term.W_t * s.translation.v.col(i));
    }
}

void Plugin::Core::keep_corrections(const Pose& posterior) {
    const Vec3 dr = log_so3(predicted.R.transpose() * posterior.R);
    const Vec3 dt = posterior.t - predicted.t;
    const auto part = [](const Mat3& v, int count, const Vec3& d) {
        double sum = 0.0;
        for (int i = 0; i < count; ++i) sum += std::pow(v.col(i).dot(d), 2);
        return std::sqrt(sum);
    };
    current.correction = dt;
    current.correction_r = dr.norm();
    current.correction_t = dt.norm();
    if (!current.v_t.allFinite()) return;  // no rows this scan
    current.correction_weak_r = part(current.v_r, current.weak_r, dr);
    current.correction_weak_t = part(current.v_t, current.weak_t, dt);
}

Status Plugin::Core::end(const Pose& posterior, bool converged) {
    const bool was_in_scan = in_scan;
    in_scan = false;
    current.converged = converged;
    if (!was_in_scan) return Status::kNoScan;
    if (!is_finite(posterior)) return Status::kBadInput;
    rejector.end_scan(predicted.inverse() * posterior);
    keep_corrections(posterior);
    return Status::kOk;
}

void Plugin::Core::publish() {
    last = current;
    columns = last.columns();
}

Plugin::Plugin() : core_(std::make_unique<Core>()) {}
Plugin::~Plugin() = default;

bool Plugin::set(const char* key, const char* value) {
    if (key == nullptr || value == nullptr) {
        core_->error = "key or value missing";
        return false;
    }
    try {
        core_->table.set(key, value);
        core_->rebuild();
        core_->error.clear();
        return true;
    } catch (const std::exception& e) {
        core_->error = e.what();
        return false;
    }
}

bool Plugin::check() {
    try {
        core_->rejection.validate();
        core_->degeneracy.validate();
        return true;
    } catch (const ConfigError& e) {
        core_->error = e.what();
        return false;
    }
}

const char* Plugin::error() const { return core_->error.c_str(); }
std::size_t Plugin::param_count() const { return core_->docs.size(); }

ParamDoc Plugin::param(std::size_t i) const {
    if (i >= core_->docs.size()) return {};
    const ParamInfo& d = core_->docs[i];
    return {d.key.c_str(),   d.type.c_str(), d.default_value.c_str(),
            d.range.c_str(), d.unit.c_str(), d.doc.c_str()};
}

bool Plugin::set_map_voxel(double size) {
    if (!(size > 0.0) || !std::isfinite(size)) {
        core_->error = "the map's voxel size must be positive";
        return false;
    }
    core_->map_voxel = size;
    core_->rebuild();
    return true;
}

bool Plugin::rejects() const { return core_->rejector.active(); }
bool Plugin::has_prior() const { return core_->prior.active(); }
bool Plugin::counts_rows() const { return core_->degeneracy.counts_rows(); }
bool Plugin::reads_surfaces() const { return core_->degeneracy.cleans_rows(); }
bool Plugin::starts_at_rest() const { return reads_surfaces() && core_->degeneracy.rest; }

void Plugin::reset() {
    core_->rebuild();
    core_->blind_now = BlindDirections{};
    core_->in_scan = false;
}

std::size_t Plugin::diagnostics_size() const { return core_->columns.size(); }
const char* Plugin::diagnostics_name(std::size_t i) const {
    return i < core_->columns.size() ? core_->columns[i].first.c_str() : nullptr;
}
double Plugin::diagnostics_value(std::size_t i) const {
    return i < core_->columns.size() ? core_->columns[i].second : kNaN;
}
const ScanDiagnostics& Plugin::diagnostics() const { return core_->last; }
const NoiseAwareConfig& Plugin::noise_aware() const { return core_->degeneracy.noise_aware; }
BlindDirections Plugin::find_blind(const SurfaceSums& sums) { return core_->find_blind(sums); }
ScanError Plugin::scan_error(double misfit) const {
    return reads_surfaces() ? d2lio::scan_error(core_->blind_now, misfit) : ScanError{};
}
void Plugin::note_cleaned(int rows) { core_->current.cleaned = rows; }

}  // namespace d2lio
