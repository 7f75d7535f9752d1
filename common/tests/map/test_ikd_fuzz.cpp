// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <random>
#include <string>

#include "d2lio/map/ikd_tree.hpp"
#include "reference_map.hpp"

namespace d2lio::test {
namespace {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr int kReduction = 8;  // sanitizers slow every operation down by about as much
#else
constexpr int kReduction = 1;
#endif

enum class Shape { kVolume, kSurface, kLattice, kCollinear, kOneVoxel, kFar };

struct Case {
    Shape shape;
    const char* name;
    int operations;
    std::size_t max_points;
    int downsample_percent;  ///< few where it would leave hardly any points
    bool background;
};

/// Random operations on the tree and on the reference side by side.
class Fuzz {
  public:
    explicit Fuzz(const Case& c, unsigned seed)
        : case_(c), random_(seed), tree_(options(c)), reference_(options(c).downsample_leaf) {}

    void run() {
        for (int i = 0; i < case_.operations / kReduction && !::testing::Test::HasFailure(); ++i) {
            step();
            if (i % kFullCheckEvery == 0) check_content();
        }
        tree_.finish_background();
        check_content();
    }

  private:
    static constexpr int kFullCheckEvery = 500;

    static IkdTreeOptions options(const Case& c) {
        IkdTreeOptions o;
        o.downsample_leaf = 0.3F;
        o.background_rebuild = c.background;
        o.background_min_points = 64;
        return o;
    }

    float uniform(float lo, float hi) {
        return std::uniform_real_distribution<float>(lo, hi)(random_);
    }
    int below(int n) { return std::uniform_int_distribution<int>(0, n - 1)(random_); }

    Eigen::Vector3f point() {
        const float x = uniform(-2.F, 2.F), y = uniform(-2.F, 2.F), z = uniform(-2.F, 2.F);
        switch (case_.shape) {
            case Shape::kVolume:
                return {x, y, z};
            case Shape::kSurface:
                return {x, y, 0.02F * z};
            case Shape::kLattice:
                return {std::floor(x), std::floor(y), std::floor(z)};
            case Shape::kCollinear:
                return {x, x, 1.F};
            case Shape::kOneVoxel:
                return {0.1F + 0.02F * x, 0.1F + 0.02F * y, 0.1F + 0.02F * z};
            default:
                return {1e6F + 100.F * x, -1e6F + 100.F * y, 100.F * z};
        }
    }
    Points cloud(int n) {
        Points points(static_cast<std::size_t>(n));
        for (Eigen::Vector3f& p : points) p = point();
        return points;
    }
    Box box() {
        const Eigen::Vector3f a = point(), b = point();
        return {a.cwiseMin(b), a.cwiseMax(b)};
    }

    void step() {
        const int what = below(100);
        if (tree_.size() > case_.max_points) {
            erase_box();
        } else if (what < 40) {
            search();
        } else if (what < 60) {
            insert(false);
        } else if (what < 88) {
            insert(below(100) < case_.downsample_percent);
        } else if (what < 91) {
            erase_points();
        } else if (what < 93) {
            erase_box();
        } else if (what < 99 || below(20) > 0) {
            search();
        } else {
            build();
        }
    }

    void insert(bool downsample) {
        const Points points = cloud(1 + below(6));
        const std::size_t before = tree_.size();
        const InsertReport report = tree_.insert(points, downsample);
        for (const Eigen::Vector3f& p : points) {
            downsample ? reference_.insert_downsampled(p) : reference_.insert(p);
        }
        ASSERT_EQ(tree_.size(), reference_.points().size());
        ASSERT_EQ(tree_.size(), before + report.added - report.removed);
        ASSERT_EQ(points.size(), report.added + report.not_nearer);
    }
    void erase_box() {
        const Box b = box();
        ASSERT_EQ(tree_.erase_box(b), reference_.erase_box(b));
    }
    void erase_points() {
        if (tree_.empty()) return;
        const auto i = static_cast<std::size_t>(below(static_cast<int>(tree_.size())));
        const Eigen::Vector3f stored = reference_.points()[i], other = point();
        const std::size_t expected = reference_.erase(stored) + reference_.erase(other);
        ASSERT_EQ(tree_.erase({stored, other}), expected);
    }
    void build() {
        const Points points = cloud(below(static_cast<int>(case_.max_points)));
        tree_.build(points);
        reference_.build(points);
    }
    void search() {
        const int k = 1 + below(12);
        const float bound =
            below(2) == 0 ? kInf : uniform(0.F, case_.shape == Shape::kFar ? 1e4F : 1.F);
        const Eigen::Vector3f query = point();
        Neighbours found;
        tree_.knn(query, k, bound, found);
        compare(found, reference_.nearest(query, k, bound));
    }
    static void compare(const Neighbours& found, const std::vector<Neighbour>& expected) {
        ASSERT_EQ(found.count, static_cast<int>(expected.size()));
        for (int i = 0; i < found.count; ++i) {
            const Neighbour& want = expected[static_cast<std::size_t>(i)];
            ASSERT_EQ(found[i].sq_dist, want.sq_dist);
            ASSERT_EQ(found[i].point(), want.point());
        }
    }
    void check_content() {
        ASSERT_TRUE(tree_.consistent());
        ASSERT_EQ(sorted(tree_.points()), sorted(reference_.points()));
        const Box b = box();
        Points inside, expected;
        tree_.box_search(b, inside);
        for (const Eigen::Vector3f& p : reference_.points()) {
            if (b.contains(p)) expected.push_back(p);
        }
        ASSERT_EQ(sorted(inside), sorted(expected));
    }

    static constexpr float kInf = std::numeric_limits<float>::infinity();
    Case case_;
    std::mt19937 random_;
    IkdTree tree_;
    ReferenceMap reference_;
};

class IkdFuzz : public ::testing::TestWithParam<Case> {};

TEST_P(IkdFuzz, AgreesWithBruteForce) { Fuzz(GetParam(), 20260101).run(); }

// 1.05 million operations in all, unless reduced.
INSTANTIATE_TEST_SUITE_P(
    Shapes, IkdFuzz,
    ::testing::Values(Case{Shape::kVolume, "volume", 200000, 300, 90, false},
                      Case{Shape::kSurface, "surface", 200000, 300, 90, false},
                      Case{Shape::kLattice, "lattice", 150000, 300, 2, false},
                      Case{Shape::kCollinear, "collinear", 150000, 300, 5, false},
                      Case{Shape::kOneVoxel, "one_voxel", 100000, 300, 1, false},
                      Case{Shape::kFar, "far", 100000, 300, 50, false},
                      Case{Shape::kVolume, "large", 15000, 5000, 50, false},
                      Case{Shape::kLattice, "many_duplicates", 15000, 5000, 1, false},
                      Case{Shape::kSurface, "background", 100000, 600, 90, true},
                      Case{Shape::kLattice, "background_duplicates", 20000, 600, 2, true}),
    [](const auto& info) { return std::string(info.param.name); });

}  // namespace
}  // namespace d2lio::test
