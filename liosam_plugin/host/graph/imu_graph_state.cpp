// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "imu_graph_state.hpp"

#include <gtsam/inference/Symbol.h>

#include <array>
#include <stdexcept>

#include "gtsam_conversions.hpp"

namespace d2lio::liosam {
namespace {

using gtsam::imuBias::ConstantBias;

/// A variable of one state: its key and its place in the joint error.
struct Block {
    gtsam::Key key;
    Eigen::Index offset, size;
};

std::array<Block, 3> blocks(const StateKeys& keys) {
    return {{{keys.pose, 0, 6}, {keys.vel, 6, 3}, {keys.bias, 9, 6}}};
}

/// Copies the rows of `row`'s variable, in the conditional it is a frontal of, into R.
void copy_rows(const gtsam::GaussianConditional& conditional, const Block& row,
               const std::array<Block, 3>& all, Eigen::MatrixXd& R) {
    const auto& model = conditional.get_model();
    if (model && model->isConstrained()) throw std::logic_error("latest state has an equality");
    auto it = conditional.beginFrontals();
    Eigen::Index first = 0;
    for (; *it != row.key; ++it) first += static_cast<Eigen::Index>(conditional.getDim(it));
    for (auto column = it; column != conditional.end(); ++column) {
        const auto* block = all.begin();
        while (block != all.end() && block->key != *column) ++block;
        if (block == all.end()) throw std::logic_error("latest state was not eliminated last");
        const gtsam::Matrix rows = conditional.getA(column).middleRows(first, row.size);
        auto target = R.block(row.offset, block->offset, row.size, block->size);
        if (column == it) {
            target = rows.triangularView<Eigen::Upper>();
        } else {
            target = rows;
        }
    }
}

Mat15x15 joint_covariance(const gtsam::ISAM2& isam, const StateKeys& keys) {
    const auto all = blocks(keys);
    Eigen::MatrixXd R = Eigen::MatrixXd::Zero(GraphIndex::kSize, GraphIndex::kSize);
    for (const Block& row : all) copy_rows(*isam[row.key]->conditional(), row, all, R);
    const Eigen::MatrixXd inverse = R.inverse();
    return inverse * inverse.transpose();
}

}  // namespace

StateKeys::StateKeys(std::size_t index)
    : pose(gtsam::Symbol('x', index)),
      vel(gtsam::Symbol('v', index)),
      bias(gtsam::Symbol('b', index)) {}

bool GraphEstimate::is_finite() const {
    return pose.matrix().allFinite() && vel.allFinite() && bias.vector().allFinite() &&
           covariance.allFinite();
}

GraphState GraphEstimate::state() const {
    GraphState s;
    s.T_map_imu = from_gtsam(pose);
    s.vel = vel;
    s.gyro_bias = bias.gyroscope();
    s.accel_bias = bias.accelerometer();
    Mat15x15 J = Mat15x15::Zero();
    J.topLeftCorner<6, 6>() = map_axes(s.T_map_imu.R);
    J.block<3, 3>(GraphIndex::kVel, 6).setIdentity();
    J.block<3, 3>(GraphIndex::kGyroBias, 12).setIdentity();
    J.block<3, 3>(GraphIndex::kAccelBias, 9).setIdentity();
    const Mat15x15 P = J * covariance * J.transpose();
    s.covariance = 0.5 * (P + P.transpose());
    return s;
}

StatePrior::StatePrior(const StateKeys& keys, const GraphEstimate& mean)
    : NoiseModelFactorN(joint_noise(mean.covariance), keys.pose, keys.vel, keys.bias),
      mean_(mean) {}

gtsam::Vector StatePrior::evaluateError(const gtsam::Pose3& pose, const gtsam::Vector3& vel,
                                        const ConstantBias& bias,
                                        boost::optional<gtsam::Matrix&> H_pose,
                                        boost::optional<gtsam::Matrix&> H_vel,
                                        boost::optional<gtsam::Matrix&> H_bias) const {
    gtsam::Matrix6 H_log;
    gtsam::Vector e(GraphIndex::kSize);
    e.head<6>() = gtsam::Pose3::Logmap(mean_.pose.between(pose), H_log);
    e.segment<3>(6) = vel - mean_.vel;
    e.tail<6>() = bias.vector() - mean_.bias.vector();
    if (H_pose) {
        *H_pose = gtsam::Matrix::Zero(GraphIndex::kSize, 6);
        H_pose->topRows<6>() = H_log;
    }
    if (H_vel) {
        *H_vel = gtsam::Matrix::Zero(GraphIndex::kSize, 3);
        H_vel->middleRows<3>(6).setIdentity();
    }
    if (H_bias) {
        *H_bias = gtsam::Matrix::Zero(GraphIndex::kSize, 6);
        H_bias->bottomRows<6>().setIdentity();
    }
    return e;
}

gtsam::NonlinearFactor::shared_ptr StatePrior::clone() const {
    return boost::make_shared<StatePrior>(*this);
}

PoseMeasurement::PoseMeasurement(gtsam::Key key, const gtsam::Pose3& measured,
                                 const Mat6& covariance)
    : NoiseModelFactorN(joint_noise(covariance), key), measured_(measured) {}

gtsam::Vector PoseMeasurement::evaluateError(const gtsam::Pose3& pose,
                                             boost::optional<gtsam::Matrix&> H) const {
    gtsam::Matrix3 H_log;
    gtsam::Vector e(6);
    e << gtsam::Rot3::Logmap(measured_.rotation().between(pose.rotation()), H_log),
        pose.translation() - measured_.translation();
    if (H) {
        *H = gtsam::Matrix::Zero(6, 6);
        H->topLeftCorner<3, 3>() = H_log;
        H->bottomRightCorner<3, 3>() = pose.rotation().matrix();
    }
    return e;
}

gtsam::NonlinearFactor::shared_ptr PoseMeasurement::clone() const {
    return boost::make_shared<PoseMeasurement>(*this);
}

GraphEstimate read_estimate(const gtsam::ISAM2& isam, std::size_t index) {
    const StateKeys keys(index);
    GraphEstimate e;
    e.pose = isam.calculateEstimate<gtsam::Pose3>(keys.pose);
    e.vel = isam.calculateEstimate<gtsam::Vector3>(keys.vel);
    e.bias = isam.calculateEstimate<ConstantBias>(keys.bias);
    // The marginal lives in the tangent space at the linearisation point, up to the relinearisation
    // threshold away from the estimate.
    Mat15x15 J = Mat15x15::Identity();
    J.topLeftCorner<6, 6>() =
        gtsam::Pose3::ExpmapDerivative(gtsam::Vector6(isam.getDelta().at(keys.pose)));
    const Mat15x15 P = J * joint_covariance(isam, keys) * J.transpose();
    e.covariance = 0.5 * (P + P.transpose());
    return e;
}

}  // namespace d2lio::liosam
