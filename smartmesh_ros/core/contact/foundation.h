// Ground that gives by its contact: a bed of springs and dampers side by side (Winkler's foundation).
#pragma once

#include "contact/contact_row.h"

namespace smartmesh {

// Sets the rows of those contacts whose ground gives. Each stands for that part of the shape below the plane of its
// contact which is nearer to it than to the others: the pressures there are its force, and their middle its place. So
// force and torque are those of all pressures, whichever contacts there are.
//
// The depths are those at the end of the step if nothing changed the motion of the body. The force changes from there
// with the stiffness and the damping of the area. A body that gives, too, is a spring in series and a damper beside it.
void lay_on_foundation(const Convex& shape, const Pose& pose, const Approach& approach, const BodySurface& body,
                       std::vector<Contact>& contacts, std::vector<ContactRow>& rows);

}  // namespace smartmesh
