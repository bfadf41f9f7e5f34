// The bytes of a MarkerArray of patches, in CDR: visualization_msgs/Marker is written field by field.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "step/shown_patch.h"

namespace smartmesh {

// What all markers of a message share. `colour`: red, green, blue, alpha. `lift` [m]: height of markers above their
// points.
struct MarkerStyle {
  std::int32_t sec;
  std::uint32_t nanosec;
  std::string frame, ns;
  float colour[4];
  double lift;
};

// Writes numbers in little-endian CDR: each is aligned to its size, counted from the end of the 4-byte header.
class CdrBytes {
 public:
  template <class Number>
  void put(Number value) {
    align(sizeof(Number));
    const auto* bytes = reinterpret_cast<const std::uint8_t*>(&value);
    data_.insert(data_.end(), bytes, bytes + sizeof(Number));
  }
  void put(const std::string& text);
  void put(const Vec3& p) { put(p.x), put(p.y), put(p.z); }
  // Makes room for points (n) of three numbers each, and returns the first number.
  double* room_for(std::size_t points);
  // Starts a message: writes the length of its sequence of elements.
  void start(std::uint32_t count);
  const std::vector<std::uint8_t>& data() const { return data_; }

 private:
  void align(std::size_t size) { data_.resize(data_.size() + (size - (data_.size() - 4) % size) % size); }
  std::vector<std::uint8_t> data_;
};

// Numbers of Marker.action.
enum class MarkerAction : std::int32_t { Add = 0, Delete = 2, DeleteAll = 3 };

// Writes a marker, with the triangles of a patch in reach; null = without triangles.
void put_marker(const MarkerStyle& style, std::int32_t id, MarkerAction action, const ShownPatch* patch,
                CdrBytes& bytes);

}  // namespace smartmesh
