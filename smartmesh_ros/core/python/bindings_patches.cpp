// What Python sees of patches of the ground that are shown.
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "python/bindings.h"
#include "shape/body_shape.h"
#include "step/deck_patches.h"
#include "step/marker_message.h"

namespace smartmesh {
namespace {

void require(bool holds, const char* what) {
  if (!holds) throw std::invalid_argument(what);
}

constexpr std::size_t MOST_SLOTS = 1u << 24;
// Largest radius of a body [m].
constexpr double MOST_RADIUS = 1e7;

struct Patches {
  nb::object kept;
  const Tiles& terrain;
  ShownPatches patches;
  std::vector<DeckPatches> on_decks;
  long layout = -1;  // of the tiles that the patches are of, also of decks

  explicit Patches(nb::object of) : kept(of), terrain(nb::cast<KeptTiles&>(of).tiles) {}

  // Takes the tiles that there are now.
  void renew() {
    long now = terrain.layout();
    for (const Deck* deck : terrain.decks()) now = std::max(now, deck->tiles.layout());
    if (std::exchange(layout, now) == now) return;
    patches.set_tiles(terrain.maps(), terrain.meshes());
    on_decks.clear();
    for (const Deck* deck : terrain.decks()) on_decks.emplace_back(*deck, static_cast<int>(on_decks.size()));
  }

  const ShownPatch& operator[](std::size_t slot) const {
    const ShownPatch* found = &patches[slot];
    for (const DeckPatches& deck : on_decks) found = &deck.first_of(slot, *found);
    return *found;
  }
  // Searches for the cells under the bodies in `slots` (n,), whose `shapes` are in the same order, with `states` (S,
  // 13) at `time` [s]. Each may touch ground within its bounding radius and the way that it moves in the time `ahead`
  // [s], at most `farthest` [m]. `always` (S,): has a patch at any height. `owners` (S,): PyBullet's bodies, which have
  // no patch on the decks that they carry.
  void search(const std::vector<const BodyShape*>& shapes, const Rows<const BodyState>& states, const Slots& slots,
              const Flags& always, const Slots& owners, double time, double ahead, double farthest) {
    renew();
    finite(time, "the time"), finite(ahead, "ahead"), finite(farthest, "farthest");
    check_counts(states.size(), always, owners), check_counts(shapes.size(), slots);
    require(states.size() <= MOST_SLOTS, "there are at most 2^24 slots");
    slots_below(slots, states.size());
    patches.resize(std::max<std::size_t>(patches.size(), states.size()));
    const std::size_t surfaces = on_decks.size() + 1;
    std::vector<FrameState> frames(1);  // the first is that of the ground at rest
    for (const DeckPatches& each : on_decks) frames.push_back(each.deck().motion.at(time));
    std::vector<std::vector<ReachingBody>> found(surfaces);
    std::vector<std::vector<std::int64_t>> searched(surfaces);
    for (std::size_t n = 0; n < slots.size(); ++n) {
      const std::int64_t slot = slots[n];
      const BodyState& state = states[slot];
      require(shapes[n] != nullptr, "each slot has a shape");
      for (std::size_t k = 0; k < surfaces; ++k) {
        if (k > 0 && on_decks[k - 1].deck().body >= 0 && on_decks[k - 1].deck().body == owners[slot]) continue;
        const auto& [pose, velocity] = frames[k];
        const double way = std::min(norm(state.linear - frames[k].velocity_at(state.pose.at)) * ahead, farthest);
        const Vec3 up = pose.rotation * Vec3{0.0, 0.0, 1.0}, middle = pose.to_local(state.pose.at);
        const double lowest = shapes[n]->lowest(state.pose, up) - dot(up, pose.at) - way;
        const double radius = shapes[n]->radius + way;
        require(std::isfinite(middle.x + middle.y + middle.z + lowest) && radius < MOST_RADIUS,
                "a body is nowhere, or too large or fast for a patch");
        found[k].push_back({middle, lowest, radius, always[slot]});
        searched[k].push_back(slot);
      }
    }
    patches.search(searched[0], found[0], time);
    for (std::size_t k = 1; k < surfaces; ++k) on_decks[k - 1].search(searched[k], found[k], patches.size(), time);
  }
  // Collects the samples of the bodies in `slots` (n,) at `time` [s]; returns those that have a patch.
  auto collect(const Slots& slots, double time) {
    renew();
    patches.collect({slots_below(slots, patches.size()).begin(), slots.end()}, finite(time, "the time"));
    for (DeckPatches& deck : on_decks) deck.collect(time);
    std::vector<std::int64_t> shown;
    std::copy_if(slots.begin(), slots.end(), std::back_inserter(shown),
                 [&](auto slot) { return (*this)[slot].is_shown; });
    return array_of(std::move(shown));
  }
  // Returns numbers of the patches of `slots` (n, 10): 1 if its points are no grid, tile, row and column of its
  // middle sample, stride, points, triangles, revision, deck, -1 = none, and 1 if the tile is a mesh; and the motion of
  // the ground there (n, 6).
  auto describe(const Slots& slots) const {
    std::vector<std::array<std::int64_t, 10>> rows;
    std::vector<FrameVelocity> motion;
    for (std::int64_t slot : slots_below(slots, patches.size())) {
      const ShownPatch& it = (*this)[slot];
      rows.push_back({it.is_mesh, it.tile, it.row, it.column, it.of_mesh ? 1 : it.square.stride,
                      static_cast<std::int64_t>(it.points.size()), static_cast<std::int64_t>(it.triangles.size()),
                      it.points_revision, it.deck, it.of_mesh});
      motion.push_back({it.linear, it.angular});
    }
    return std::make_tuple(array_of(std::move(rows)), array_of(std::move(motion)));
  }
  // Returns the points (N, 3) [m] and triangles (T, 3) of the patches of `slots`, one patch after the other.
  auto geometry(const Slots& slots) const {
    std::vector<Vec3> points;
    std::vector<std::array<std::int32_t, 3>> triangles;
    for (std::int64_t slot : slots_below(slots, patches.size())) {
      const ShownPatch& it = (*this)[slot];
      points.insert(points.end(), it.points.begin(), it.points.end());
      triangles.insert(triangles.end(), it.triangles.begin(), it.triangles.end());
    }
    return std::make_tuple(array_of(std::move(points)), array_of(std::move(triangles)));
  }
  // Returns numbers that change with the markers of the patches of `slots` (n,).
  auto marker_revisions(const Slots& slots) const {
    std::vector<std::int64_t> found;
    for (std::int64_t slot : slots_below(slots, patches.size())) found.push_back((*this)[slot].near_revision);
    return array_of(std::move(found));
  }
  // Returns the bytes of a MarkerArray: first a marker that deletes all if `clears`, then the patches of `slots` (n,)
  // with their `ids` (n,), `lift` [m] above the ground, then markers that delete those of `gone` (m,).
  nb::bytes markers(const Slots& slots, const Slots& ids, const Slots& gone, bool clears,
                    std::tuple<std::int32_t, std::uint32_t> stamp, const std::string& frame, const std::string& ns,
                    const std::tuple<float, float, float, float>& colour, double lift) {
    const auto [red, green, blue, alpha] = colour;
    const MarkerStyle style{std::get<0>(stamp),        std::get<1>(stamp),      frame, ns,
                            {red, green, blue, alpha}, finite(lift, "the lift")};
    slots_below(slots, patches.size()), check_counts(slots.size(), ids);
    bytes_.start(static_cast<std::uint32_t>(clears + slots.size() + gone.size()));
    if (clears) put_marker(style, -1, MarkerAction::DeleteAll, nullptr, bytes_);
    for (std::size_t k = 0; k < slots.size(); ++k)
      put_marker(style, static_cast<std::int32_t>(ids[k]), MarkerAction::Add, &(*this)[slots[k]], bytes_);
    for (const std::int64_t id : gone)
      put_marker(style, static_cast<std::int32_t>(id), MarkerAction::Delete, nullptr, bytes_);
    return nb::bytes(bytes_.data().data(), bytes_.data().size());
  }

 private:
  CdrBytes bytes_;
};

}  // namespace

void add_patches(nb::module_& m) {
  nb::class_<Patches>(m, "Patches")
      .def(nb::init<nb::object>(), "tiles"_a)
      .def("search", &Patches::search, "shapes"_a, "states"_a, "slots"_a, "always"_a, "owners"_a, "time"_a, "ahead"_a,
           "farthest"_a)
      .def("collect", &Patches::collect, "slots"_a, "time"_a)
      .def("describe", &Patches::describe, "slots"_a)
      .def("geometry", &Patches::geometry, "slots"_a)
      .def("marker_revisions", &Patches::marker_revisions, "slots"_a)
      .def("markers", &Patches::markers, "slots"_a, "ids"_a, "gone"_a, "clears"_a, "stamp"_a, "frame"_a, "namespace"_a,
           "colour"_a, "lift"_a);
}

}  // namespace smartmesh
