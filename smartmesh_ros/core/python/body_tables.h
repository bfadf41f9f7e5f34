// Tables of the shapes and states of bodies, which Python gives to the core.
#pragma once

#include "python/tables.h"
#include "shape/solid.h"

namespace smartmesh {

inline void require(bool holds, const char* what) {
  if (!holds) throw std::invalid_argument(what);
}

// Shapes of bodies by slot; the arrays stay alive with them. `shapes`, `parts`: records of SHAPE as bytes.
struct Shapes {
  ShapeTable table;
  Bytes2 shapes, parts;
  Doubles2 vertices;

  Shapes(Bytes2 shapes_s, Bytes2 parts_p, Doubles2 vertices_v3)
      : shapes(shapes_s), parts(parts_p), vertices(vertices_v3) {
    table.shapes = records_of<Shape>(shapes, "shapes");
    table.parts = records_of<Shape>(parts, "parts");
    table.vertices = records_of<Vec3>(vertices, "vertices");
    table.shape_count = static_cast<std::int64_t>(shapes.shape(0));
    table.part_count = static_cast<std::int64_t>(parts.shape(0));
    table.vertex_count = static_cast<std::int64_t>(vertices.shape(0));
  }
};

// The states (S, 13) of bodies and their shapes.
struct Bodies {
  const ShapeTable& table;
  const BodyState* states;
  std::int64_t count;

  Bodies(const Shapes& shapes, const Doubles2& states_s)
      : table(shapes.table),
        states(records_of<BodyState>(states_s, "states")),
        count(static_cast<std::int64_t>(states_s.shape(0))) {}
  const Shape& shape(std::int64_t slot) const {
    require(slot >= 0 && slot < table.shape_count && slot < count, "a slot has no shape or no state");
    return table.shapes[slot];
  }
  void place(std::int64_t slot, BodySolid& placed) const {
    require(table.has_all_of(shape(slot)), "a shape names parts or vertices that are not there");
    place_shape(table, shape(slot), states[slot].pose, placed);
  }
};

}  // namespace smartmesh
