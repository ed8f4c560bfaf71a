// SPDX-License-Identifier: BSD-3-Clause
//
// A program that uses no symbol of bocst or FCL and opens planners: host PLUGIN. Exits as the planner does.

#include <dlfcn.h>

#include <cstdio>

int main(int, char** argv) {
  void* plugin = dlopen(argv[1], RTLD_NOW | RTLD_LOCAL);
  auto* planner = plugin != nullptr ? reinterpret_cast<int (*)()>(dlsym(plugin, "planner")) : nullptr;
  if (planner == nullptr) {
    std::printf("%s\n", dlerror());
    return 2;
  }
  return planner();
}
