// A deck: height maps and meshes that ride on a moving frame, with all six degrees of freedom. All that is asked of a
// deck is asked of its tiles in the deck's frame, by the code that serves the ground at rest.
#pragma once

#include "ground/frame_motion.h"
#include "ground/ground_rays.h"
#include "ground/tiles.h"

namespace smartmesh {

// `thickness` [m]: a body whose middle is farther than this below the deck does not touch it. `body`, `link`:
// PyBullet's numbers of what carries the deck, -1 = nothing; `place`: of the deck's frame in that of the carrier's
// centre of mass.
struct Deck {
  Tiles tiles;
  FrameMotion motion;
  double thickness = INFINITE;
  int body = -1, link = -1;
  FrameSample place;

  // Returns the bounds in the deck's frame of what lies inside some bounds of the world.
  static Bounds local_bounds(const Pose& pose, const Bounds& bounds);
  // Returns true if a point of the deck's frame is below the deck by more than its thickness at `time` [s].
  bool is_above(const Vec3& p, double time) const;
  // Adds the deck's samples inside bounds of the world, if it is near them, and where its frame is.
  void add_ground_under(const Bounds& bounds, double time, GroundUnder& found);
};

// A deck at one instant, for queries.
struct DeckReader {
  const Deck* deck;
  FrameState frame;
  GroundRays rays;
  GroundReader ground;

  DeckReader(const Deck& deck, double time);

  // Returns what a ray of the world meets first.
  RayHit first_hit(const Ray& ray);
  // Returns the highest ground at (p.x, p.y) that is at most as high as `p`.
  GroundSample below(const Vec3& p) { return first_along(p, -1.0); }
  // Returns the ground over `p` if that is in a height map, as seen in the deck's frame, which is solid as far down as
  // the deck is thick; else the ground below `p`; where there is none, and `p` is below a mesh, the highest that is not
  // farther above `p` than the deck is thick.
  GroundSample near(const Vec3& p);

 private:
  // Returns the ground that is first above `p`, or below it for `up` -1.
  GroundSample first_along(const Vec3& p, double up);
};

}  // namespace smartmesh
