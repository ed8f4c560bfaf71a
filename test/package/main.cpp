// SPDX-License-Identifier: BSD-3-Clause
// What a user's program looks like: two meshes, one from code and one from a file, collided through FCL's own names.

#include <bocst/bocst.h>
#include <bocst/io.h>

#include <fstream>
#include <iostream>
#include <memory>
#include <vector>

namespace {

std::shared_ptr<const bocst::Mesh> tetrahedron() {
  return std::make_shared<bocst::Mesh>(std::vector<Eigen::Vector3d>{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
                                       std::vector<fcl::Triangle>{{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}});
}

std::shared_ptr<const bocst::Mesh> tetrahedronFromFile() {
  std::ofstream("tetrahedron.off") << "OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n";
  return bocst::loadMesh("tetrahedron.off");
}

int failures = 0;

void expect(bool holds, const char* what) {
  std::cout << (holds ? "ok:     " : "FAILED: ") << what << '\n';
  failures += !holds;
}

template <typename S>
std::size_t contactsAt(S x) {
  const auto a = std::make_shared<bocst::Model<S>>(tetrahedron());
  const auto b = std::make_shared<bocst::Model<S>>(tetrahedronFromFile());
  const fcl::CollisionObject<S> first(a);
  const fcl::CollisionObject<S> second(b, fcl::Matrix3<S>::Identity(), fcl::Vector3<S>(x, S(0.1), S(0.1)));
  fcl::CollisionRequest<S> request(100, true);
  fcl::CollisionResult<S> result;
  return fcl::collide(&first, &second, request, result);
}

}  // namespace

int main() {
  expect(tetrahedronFromFile()->triangleCount() == 4, "bocst::io reads a mesh");
  expect(contactsAt<double>(0.3) > 0, "a hit in double");
  expect(contactsAt<double>(1.5) == 0, "a free pose in double");
  expect(contactsAt<float>(0.3f) > 0, "a hit in float");
  expect(contactsAt<float>(1.5f) == 0, "a free pose in float");
  return failures == 0 ? 0 : 1;
}
