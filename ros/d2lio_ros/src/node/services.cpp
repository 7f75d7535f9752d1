// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/ros1/node.hpp"

namespace d2lio::ros1 {

/// Runs `f`, which fills the response, between two scans; a failure goes into the response.
template <typename Response, typename F>
bool Node::serve(Response& response, const F& f) {
    try {
        if (worker_.call(f)) return true;
        response.message = "the node is shutting down";
    } catch (const std::exception& e) {
        response.message = e.what();
    }
    response.success = false;
    return true;
}

/// Where a file goes: the path of the request, else into the node's folder.
std::string Node::target(const std::string& path, const char* file) const {
    if (!path.empty()) return path;
    if (recorder_.folder().empty()) {
        throw std::invalid_argument("no path given, and the node has no save_dir");
    }
    return recorder_.folder() + "/" + file;
}

bool Node::save_map(SaveFile::Request& request, SaveFile::Response& response) {
    return serve(response, [&] {
        const std::string path = target(request.path, "map.pcd");
        const std::vector<Eigen::Vector3f> points = worker_.map_points();
        const std::string error = replace_file(path, to_pcd(points));
        response.success = error.empty();
        response.message =
            error.empty() ? std::to_string(points.size()) + " points in " + path : error;
    });
}

bool Node::save_trajectory(SaveFile::Request& request, SaveFile::Response& response) {
    return serve(response, [&] {
        const std::string path = target(request.path, "trajectory_so_far.tum");
        const std::string error = replace_file(path, recorder_.trajectory_text());
        response.success = error.empty();
        response.message =
            error.empty() ? std::to_string(recorder_.poses().size()) + " poses in " + path : error;
    });
}

bool Node::set_mode(SetMode::Request& request, SetMode::Response& response) {
    return serve(response, [&] {
        ParamMap changes;
        if (!request.rejection_mode.empty()) changes["rejection.mode"] = request.rejection_mode;
        if (!request.degeneracy_method.empty()) {
            changes["degeneracy.method"] = request.degeneracy_method;
        }
        const bool goes_on = worker_.set_params(changes);
        if (!goes_on) outputs_.forget_path();
        response.message =
            goes_on ? "changed; the estimate goes on" : "changed; the estimator started anew";
        response.success = true;
        ROS_INFO_STREAM("mode '" << request.rejection_mode << "', method '"
                                 << request.degeneracy_method << "': " << response.message);
    });
}

bool Node::reset(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
    return serve(response, [&] {
        worker_.reset();
        outputs_.forget_path();
        response.success = true;
        response.message = "the estimator started anew";
        ROS_INFO("reset: the estimator started anew");
    });
}

bool Node::publish_map(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
    return serve(response, [&] {
        const std::vector<Eigen::Vector3f> points = worker_.map_points();
        outputs_.publish_map(points);
        response.success = true;
        response.message = std::to_string(points.size()) + " points published";
    });
}

}  // namespace d2lio::ros1
