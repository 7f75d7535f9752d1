// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cstring>

#include "d2lio/geometry/so3.hpp"
#include "d2lio/ros1/messages.hpp"

namespace d2lio::ros1 {
namespace {

sensor_msgs::PointCloud2 make_cloud(std::size_t count, std::size_t step, Stamp stamp,
                                    const std::string& frame) {
    sensor_msgs::PointCloud2 cloud;
    cloud.header.stamp = to_time(stamp);
    cloud.header.frame_id = frame;
    cloud.height = 1;
    cloud.width = static_cast<std::uint32_t>(count);
    cloud.point_step = static_cast<std::uint32_t>(step);
    cloud.row_step = static_cast<std::uint32_t>(count * step);
    cloud.is_dense = 1;
    cloud.data.resize(count * step);
    return cloud;
}

void add_field(sensor_msgs::PointCloud2& cloud, const char* name, std::uint32_t offset,
               std::uint8_t datatype) {
    sensor_msgs::PointField field;
    field.name = name;
    field.offset = offset;
    field.datatype = datatype;
    field.count = 1;
    cloud.fields.push_back(field);
}

void add_xyz(sensor_msgs::PointCloud2& cloud) {
    const char* const names[] = {"x", "y", "z"};
    for (std::uint32_t i = 0; i < 3; ++i) {
        add_field(cloud, names[i], 4 * i, sensor_msgs::PointField::FLOAT32);
    }
}

}  // namespace

sensor_msgs::PointCloud2 to_cloud(const std::vector<Eigen::Vector3f>& points, Stamp stamp,
                                  const std::string& frame) {
    static_assert(sizeof(Eigen::Vector3f) == 12, "points are packed");
    sensor_msgs::PointCloud2 cloud = make_cloud(points.size(), 12, stamp, frame);
    add_xyz(cloud);
    if (!points.empty()) std::memcpy(cloud.data.data(), points.data(), cloud.data.size());
    return cloud;
}

sensor_msgs::PointCloud2 to_cloud(const std::vector<LidarPoint>& points, Stamp stamp,
                                  const std::string& frame) {
    sensor_msgs::PointCloud2 cloud = make_cloud(points.size(), 16, stamp, frame);
    add_xyz(cloud);
    add_field(cloud, "intensity", 12, sensor_msgs::PointField::FLOAT32);
    std::uint8_t* to = cloud.data.data();
    for (const LidarPoint& p : points) {
        const float row[] = {p.x, p.y, p.z, p.intensity};
        std::memcpy(to, row, sizeof row);
        to += sizeof row;
    }
    return cloud;
}

std::uint32_t colour_of(Verdict verdict) {
    switch (verdict) {
        case Verdict::kAccepted:
            return 0x2ca02c;
        case Verdict::kFewNeighbours:
            return 0x9467bd;
        case Verdict::kFarNeighbours:
            return 0x1f77b4;
        case Verdict::kThreshold:
            return 0xd62728;
        case Verdict::kSingularPlane:
            return 0x8c564b;
        case Verdict::kPlaneFit:
            return 0xff7f0e;
        case Verdict::kResidual:
            break;
    }
    return 0xe377c2;
}

sensor_msgs::PointCloud2 to_rejected(const ScanPoints& scan, Stamp stamp,
                                     const std::string& frame) {
    std::vector<std::size_t> rejected;
    for (std::size_t i = 0; i < std::min(scan.points.size(), scan.verdicts.size()); ++i) {
        if (scan.verdicts[i] != Verdict::kAccepted) rejected.push_back(i);
    }
    sensor_msgs::PointCloud2 cloud = make_cloud(rejected.size(), 17, stamp, frame);
    add_xyz(cloud);
    add_field(cloud, "rgb", 12, sensor_msgs::PointField::FLOAT32);
    add_field(cloud, "reason", 16, sensor_msgs::PointField::UINT8);
    std::uint8_t* to = cloud.data.data();
    for (const std::size_t i : rejected) {
        const std::uint32_t rgb = colour_of(scan.verdicts[i]);
        std::memcpy(to, scan.points[i].data(), 12);
        std::memcpy(to + 12, &rgb, 4);
        to[16] = static_cast<std::uint8_t>(scan.verdicts[i]);
        to += 17;
    }
    return cloud;
}

std::vector<LidarPoint> registered(const Scan& scan, const Pose& previous, Stamp previous_stamp,
                                   const Pose& current, Stamp stamp, const Pose& T_imu_lidar,
                                   double blind) {
    std::vector<LidarPoint> out;
    out.reserve(scan.points.size());
    const double span = seconds_between(stamp, previous_stamp);
    const Vec3 turn = log_so3(previous.R.transpose() * current.R);
    constexpr int kSteps = 64;  // poses along the scan
    std::vector<Pose> poses;
    for (int i = 0; i <= kSteps; ++i) {
        const double share = static_cast<double>(i) / kSteps;
        const Pose at{previous.R * exp_so3(share * turn),
                      previous.t + share * (current.t - previous.t)};
        poses.push_back(at * T_imu_lidar);
    }
    for (const LidarPoint& p : scan.points) {
        const Vec3 q = p.xyz().cast<double>();
        if (!q.allFinite() || q.norm() <= blind) continue;
        const double since = seconds_between(scan.stamp + p.dt_ns, previous_stamp);
        const double share = span > 0.0 ? std::clamp(since / span, 0.0, 1.0) : 1.0;
        const Pose& pose = poses[static_cast<std::size_t>(std::lround(share * kSteps))];
        const Eigen::Vector3f m = (pose * q).cast<float>();
        LidarPoint moved = p;
        moved.x = m.x();
        moved.y = m.y();
        moved.z = m.z();
        out.push_back(moved);
    }
    return out;
}

std::string to_pcd(const std::vector<Eigen::Vector3f>& points) {
    const std::string n = std::to_string(points.size());
    std::string out =
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z\n"
        "SIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH " +
        n + "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " + n + "\nDATA binary\n";
    out.append(reinterpret_cast<const char*>(points.data()), points.size() * 12);
    return out;
}

}  // namespace d2lio::ros1
