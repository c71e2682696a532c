// Shared objects that are built while the program runs.
#pragma once

#include <dlfcn.h>

#include <cstdint>
#include <stdexcept>
#include <string>

namespace fisherpoint {

// What the function `name` of a shared object, which stays loaded, returns: a table that begins with its version. Throws
// std::runtime_error where there is none, or of another version.
template <class Function>
auto table_of(const std::string& path, const std::string& name, std::int32_t version) {
  void* const library = dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (!library) throw std::runtime_error(path + ": expected a shared object, given: " + dlerror());
  const auto function = reinterpret_cast<Function*>(dlsym(library, name.c_str()));
  if (!function) throw std::runtime_error(path + ": expected the function " + name + ", given none");
  const auto table = function();
  if (table->version != version)
    throw std::runtime_error(path + ": expected version " + std::to_string(version) + " of the kernels' interface, given " +
                             std::to_string(table->version));
  return table;
}

}  // namespace fisherpoint
