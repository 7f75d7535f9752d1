// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <random>
#include <thread>

#include "d2lio/map/ikd_tree.hpp"
#include "reference_map.hpp"

namespace d2lio::test {
namespace {

constexpr float kInfF = std::numeric_limits<float>::infinity();

IkdTreeOptions background_options() {
    IkdTreeOptions options;
    options.background_rebuild = true;
    options.background_min_points = 500;
    options.downsample_leaf = 0.1F;
    return options;
}

IkdTreeOptions synchronous_options() {
    IkdTreeOptions options = background_options();
    options.background_rebuild = false;
    return options;
}

/// Points ahead of a sensor that moves along x, so that the tree leans to one side.
Points ahead(unsigned step, std::size_t n) {
    std::mt19937 random(step);
    std::uniform_real_distribution<float> u(0.F, 4.F);
    Points points(n);
    for (Eigen::Vector3f& p : points) {
        p.x() = static_cast<float>(step) + u(random);
        p.y() = u(random);
        p.z() = u(random);
    }
    return points;
}

void expect_same_searches(const IkdTree& a, const IkdTree& b, unsigned step) {
    for (const Eigen::Vector3f& q : ahead(step, 50)) {
        Neighbours na, nb;
        a.knn(q, 5, kInfF, na);
        b.knn(q, 5, kInfF, nb);
        ASSERT_EQ(na.count, nb.count);
        for (int i = 0; i < na.count; ++i) {
            ASSERT_EQ(na[i].point(), nb[i].point());
            ASSERT_EQ(na[i].sq_dist, nb[i].sq_dist);
        }
    }
}

TEST(IkdTreeBackground, SearchesEqualTheSynchronousOnes) {
    IkdTree background(background_options()), synchronous(synchronous_options());
    for (unsigned step = 0; step < 150; ++step) {
        const Points cloud = ahead(step, 400);
        const Box behind{{-1e9F, -1e9F, -1e9F}, {static_cast<float>(step) - 30.F, 1e9F, 1e9F}};
        const Points stored(cloud.begin(), cloud.begin() + 20);
        for (IkdTree* tree : {&background, &synchronous}) {
            tree->insert(cloud, step % 2 == 0);
            tree->erase_box(behind);
            tree->erase(stored);
        }
        expect_same_searches(background, synchronous, step);
        ASSERT_TRUE(background.consistent());
    }
    EXPECT_EQ(sorted(background.points()), sorted(synchronous.points()));
}

TEST(IkdTreeBackground, BalancesOnceItHasCaughtUp) {
    IkdTree tree(background_options());
    for (unsigned step = 0; step < 100; ++step) tree.insert(ahead(step, 300), false);
    for (int i = 0; i < 100; ++i) {
        tree.finish_background();
        tree.insert({}, false);  // looks for the next subtree to rebuild
    }
    EXPECT_TRUE(tree.consistent());
    EXPECT_EQ(tree.size(), 30000U);
    EXPECT_LE(tree.depth(), 20);
}

TEST(IkdTreeBackground, SurvivesOneHugeSortedInsertion) {
    Points line;
    for (int i = 0; i < 200000; ++i) line.emplace_back(0.1F * static_cast<float>(i), 0.F, 0.F);
    IkdTree tree(background_options());
    tree.insert(line, false);
    EXPECT_TRUE(tree.consistent()) << "within the depth the searches can hold";
    Neighbours found;
    tree.knn({1000.F, 0.F, 0.F}, 3, kInfF, found);
    EXPECT_EQ(found.count, 3);
}

TEST(IkdTreeBackground, ContentMayGoWhileBeingRebuilt) {
    for (unsigned round = 0; round < 30; ++round) {
        IkdTree tree(background_options());
        tree.insert(ahead(0, 2000), false);
        tree.insert(ahead(10, 3000), false);  // starts a rebuild
        if (round % 3 == 0) tree.erase_box({{-1e9F, -1e9F, -1e9F}, {1e9F, 1e9F, 1e9F}});
        if (round % 3 == 1) tree.build(ahead(3, 700));
        tree.insert(ahead(5, 100), false);
        tree.finish_background();
        const std::size_t expected = round % 3 == 0 ? 100 : round % 3 == 1 ? 800 : 5100;
        EXPECT_EQ(tree.size(), expected);
        EXPECT_TRUE(tree.consistent());
        if (round % 2 == 0) tree.insert(ahead(20, 5000), false);
    }  // the destructor meets a rebuild under way
}

TEST(IkdTreeBackground, ReadersMaySearchWhileItWorks) {
    IkdTree tree(background_options());
    for (unsigned step = 0; step < 20; ++step) {
        tree.insert(ahead(step, 2000), false);
        std::array<int, 2> counts{};
        std::array<std::thread, 2> readers;
        for (std::size_t r = 0; r < 2; ++r) {
            readers[r] = std::thread([&tree, &count = counts[r], step] {
                for (const Eigen::Vector3f& q : ahead(step, 200)) {
                    Neighbours found;
                    tree.knn(q, 5, kInfF, found);
                    count += found.count;
                }
            });
        }
        for (std::thread& reader : readers) reader.join();
        EXPECT_EQ(counts[0], 1000);
        EXPECT_EQ(counts[1], 1000);
    }
}

}  // namespace
}  // namespace d2lio::test
