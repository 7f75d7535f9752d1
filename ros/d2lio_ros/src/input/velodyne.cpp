// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "d2lio/ros1/byte_reader.hpp"
#include "d2lio/ros1/decode.hpp"

/// A packet holds 12 blocks of 100 bytes: flag 0xFFEE, azimuth in 0.01 deg, 32 channels of distance
/// in 2 mm and reflectivity; then a clock, the return mode and the product. Elevations and firing
/// times are those of the sensors' manuals (VLP-16 user manual, chapter 9; HDL-32E, appendix E).
namespace d2lio::ros1 {
namespace {

constexpr std::size_t kPacketBytes = 1206, kPlainBytes = 8 + kPacketBytes;
constexpr int kBlocks = 12, kChannels = 32;
constexpr std::uint16_t kUpperBank = 0xEEFF;  // bytes FF EE
constexpr int kTurn = 36'000;                 // azimuth units of 0.01 deg
constexpr double kDistanceUnit = 0.002;       // m
constexpr std::uint8_t kDualReturn = 0x39;
constexpr Stamp kMaxStampApart = 1'000'000'000;  // a packet further from its header is none of it
constexpr double kRadians = 3.14159265358979323846 / 180.0;

struct Model {
    std::array<double, kChannels> elevations{};    ///< rad, by channel of a block
    std::array<double, kChannels> offsets{};       ///< ns, firing time after the block's first
    std::array<std::uint16_t, kChannels> rings{};  ///< 0 the lowest
    double block_ns = 0.0;                         ///< from block to block, single return
};

Model with_rings(Model m) {
    const std::set<double> levels(m.elevations.begin(), m.elevations.end());
    for (std::size_t i = 0; i < kChannels; ++i) {
        m.rings[i] =
            static_cast<std::uint16_t>(std::distance(levels.begin(), levels.find(m.elevations[i])));
    }
    return m;
}

Model vlp16() {
    Model m;
    for (int i = 0; i < kChannels; ++i) {
        const int laser = i % 16, firing = i / 16, pair = laser / 2;
        const auto at = static_cast<std::size_t>(i);
        m.elevations[at] = (laser % 2 == 0 ? -15.0 + 2 * pair : 1.0 + 2 * pair) * kRadians;
        m.offsets[at] = 2'304.0 * laser + 55'296.0 * firing;
    }
    m.block_ns = 110'592.0;
    return with_rings(m);
}

Model hdl32e() {
    Model m;
    for (int i = 0; i < kChannels; ++i) {
        const double low = -92.0 / 3.0 + 4.0 / 3.0 * (i / 2);
        const auto at = static_cast<std::size_t>(i);
        m.elevations[at] = (i % 2 == 0 ? low : low + 64.0 / 3.0) * kRadians;
        m.offsets[at] = 1'152.0 * i;
    }
    m.block_ns = 46'080.0;
    return with_rings(m);
}

struct Block {
    std::uint16_t azimuth = 0;
    bool good = false;
    double step = 0.0;  ///< azimuth turned to the next block, 0.01 deg
    std::array<std::uint16_t, kChannels> distance{};
    std::array<std::uint8_t, kChannels> reflectivity{};
};

struct Packet {
    Stamp stamp = 0;
    Stamp begin = 0;  ///< first firing, ns from the header stamp
    bool dual = false;
    std::uint8_t product = 0;
    std::array<Block, kBlocks> blocks;
};

using Counts = std::map<std::string, std::size_t>;

Packet parse(Stamp stamp, const std::uint8_t* bytes, Counts& counts) {
    ByteReader in(bytes, kPacketBytes);
    Packet p;
    p.stamp = stamp;
    for (Block& b : p.blocks) {
        const auto flag = in.read<std::uint16_t>();
        b.azimuth = in.read<std::uint16_t>();
        b.good = flag == kUpperBank && b.azimuth < kTurn;
        if (!b.good) ++counts["blocks_wrong_flag"];
        for (std::size_t c = 0; c < kChannels; ++c) {
            b.distance[c] = in.read<std::uint16_t>();
            b.reflectivity[c] = in.read<std::uint8_t>();
        }
    }
    in.read<std::uint32_t>();
    p.dual = in.read<std::uint8_t>() == kDualReturn;
    p.product = in.read<std::uint8_t>();
    if (p.dual) ++counts["packets_dual_return"];
    return p;
}

/// Packets as uint8[1206], or as uint8[] with a size each.
bool read_packets(ByteReader in, std::size_t count, std::vector<Packet>& out, Counts& counts) {
    const bool plain = in.left() == count * kPlainBytes;
    for (std::size_t i = 0; i < count && in.ok(); ++i) {
        const auto sec = in.read<std::uint32_t>();
        const auto nsec = in.read<std::uint32_t>();
        const std::size_t size = plain ? kPacketBytes : in.read<std::uint32_t>();
        const std::uint8_t* bytes = in.take(size);
        if (bytes == nullptr) return false;
        if (size != kPacketBytes) {
            ++counts["packets_wrong_size"];
            continue;
        }
        out.push_back(parse(Stamp{sec} * 1'000'000'000 + nsec, bytes, counts));
    }
    return in.ok();
}

const Model* find_model(const std::vector<Packet>& packets, const std::string& name,
                        std::string& error) {
    static const Model kVlp16 = vlp16(), kHdl32e = hdl32e();
    std::set<int> products;
    for (const Packet& p : packets) products.insert(p.product);
    const bool is_vlp16 = products.count(0x22) > 0, is_hdl32e = products.count(0x21) > 0;
    if (is_vlp16 != is_hdl32e) return is_vlp16 ? &kVlp16 : &kHdl32e;
    if (name == "vlp16" || packets.empty()) return &kVlp16;
    if (name == "hdl32e") return &kHdl32e;
    error = "VelodyneScan of a sensor with product byte";
    for (const int p : products) error += " " + std::to_string(p);
    error += "; known are 34 (vlp16) and 33 (hdl32e), or name one of the two as lidar/model";
    return nullptr;
}

/// Sets when each packet began; those far from the header's stamp are dropped.
void place_in_time(std::vector<Packet>& packets, Stamp header, const Model& model, Counts& counts) {
    const bool stamped =
        std::any_of(packets.begin(), packets.end(), [](const Packet& p) { return p.stamp != 0; });
    for (std::size_t i = 0; i < packets.size(); ++i) {
        // Some drivers leave the packets' stamps empty.
        const double regular = static_cast<double>(i) * kBlocks * model.block_ns;
        packets[i].begin = stamped ? packets[i].stamp - header : std::llround(regular);
    }
    const auto bad = std::remove_if(packets.begin(), packets.end(), [](const Packet& p) {
        return std::abs(p.begin) > kMaxStampApart;
    });
    if (bad != packets.end()) {
        counts["packets_wrong_stamp"] += static_cast<std::size_t>(packets.end() - bad);
    }
    packets.erase(bad, packets.end());
}

double median(std::vector<double> v) {
    if (v.empty()) return 0.0;
    std::sort(v.begin(), v.end());
    const std::size_t half = v.size() / 2;
    return v.size() % 2 == 1 ? v[half] : 0.5 * (v[half - 1] + v[half]);
}

/// Azimuth from block to block. The last block of a packet, and blocks beside a bad one, take the
/// scan's median.
void find_steps(std::vector<Packet>& packets) {
    std::vector<double> usable;
    for (Packet& p : packets) {
        const std::size_t stride = p.dual ? 2 : 1;
        for (std::size_t b = 0; b + stride < kBlocks; ++b) {
            const int turned = p.blocks[b + stride].azimuth - p.blocks[b].azimuth;
            p.blocks[b].step = (turned % kTurn + kTurn) % kTurn;
        }
        // Of two returns the last ones stand first; the strongest stays.
        for (std::size_t b = 0; p.dual && b < kBlocks; b += 2) p.blocks[b].good = false;
        for (const Block& b : p.blocks) {
            if (b.good && b.step > 0.0 && b.step < kTurn / 8.0) usable.push_back(b.step);
        }
    }
    const double middle = median(std::move(usable));
    for (Packet& p : packets) {
        for (Block& b : p.blocks) {
            const bool fine =
                b.good && b.step > 0.0 && b.step < kTurn / 8.0 && b.step < 2.0 * middle;
            if (!fine) b.step = middle;
        }
    }
}

void add_points(const Packet& packet, std::size_t index, const Model& model, RawScan& out) {
    const Block& block = packet.blocks[index];
    if (!block.good) return;
    const double order = static_cast<double>(packet.dual ? index / 2 : index);
    for (std::size_t c = 0; c < kChannels; ++c) {
        if (block.distance[c] == 0) continue;
        const double turned = block.azimuth + block.step * (model.offsets[c] / model.block_ns);
        const double angle = turned * 0.01 * kRadians;
        const double metres = block.distance[c] * kDistanceUnit;
        const double flat = metres * std::cos(model.elevations[c]);
        LidarPoint p;
        p.x = static_cast<float>(flat * std::cos(angle));
        p.y = static_cast<float>(-flat * std::sin(angle));  // clockwise seen from above
        p.z = static_cast<float>(metres * std::sin(model.elevations[c]));
        p.intensity = block.reflectivity[c];
        p.ring = model.rings[c];
        out.points.push_back(p);
        const double time =
            static_cast<double>(packet.begin) + order * model.block_ns + model.offsets[c];
        out.integer_times.push_back(std::llrint(time));
    }
}

}  // namespace

bool decode_velodyne(const RawMessage& message, const std::string& model_name, RawScan& out,
                     std::string& error, Counts& counts) {
    ByteReader in(message.bytes.data(), message.bytes.size());
    out.stamp = in.header();
    const std::size_t count = in.read<std::uint32_t>();
    std::vector<Packet> packets;
    if (!in.ok() || !read_packets(in, count, packets, counts)) {
        error = "VelodyneScan claims " + std::to_string(count) + " packets but holds only " +
                std::to_string(message.bytes.size()) + " bytes";
        return false;
    }
    const Model* model = find_model(packets, model_name, error);
    if (model == nullptr) return false;
    place_in_time(packets, out.stamp, *model, counts);
    find_steps(packets);
    out.times_in_ns_from_stamp = true;
    for (const Packet& packet : packets) {
        for (std::size_t b = 0; b < kBlocks; ++b) add_points(packet, b, *model, out);
    }
    return true;
}

}  // namespace d2lio::ros1
