// What the ground of a height map is made of: layers of one number for each sample.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

namespace smartmesh {

// As in terrain/material.py. Friction: coefficient, by which that of a body is multiplied. Soil: place of the sample's soil
// in a list.
enum class Layer : int { Friction, Soil };
constexpr int LAYERS = 2;
// The number of each layer where nothing is known of the ground.
constexpr std::array<double, LAYERS> USUAL{1.0, 0.0};

// One property of the ground. `samples` (rows, columns), NaN = the usual number; empty: `uniform` everywhere.
struct MaterialLayer {
  bool is_given = false;
  std::vector<float> samples;
  double uniform = 0.0;
};

struct Materials {
  std::array<MaterialLayer, LAYERS> layers;

  MaterialLayer& operator[](Layer layer) { return layers[static_cast<int>(layer)]; }
  const MaterialLayer& operator[](Layer layer) const { return layers[static_cast<int>(layer)]; }
  bool has(Layer layer) const { return (*this)[layer].is_given; }
  // Returns the number of a sample by its index in the map.
  double at(Layer layer, std::size_t index) const {
    const MaterialLayer& it = (*this)[layer];
    const double found = it.samples.empty() ? it.uniform : static_cast<double>(it.samples[index]);
    return it.is_given && !std::isnan(found) ? found : USUAL[static_cast<int>(layer)];
  }
};

}  // namespace smartmesh
