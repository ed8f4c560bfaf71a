# Writes a source file that defines shader() of a header and its namespace: the text of shaders, so that what is
# installed needs no files.
function(bocst_embed_shaders output header namespace)
  set(entries "")
  foreach(file IN LISTS ARGN)
    file(READ ${file} text)
    get_filename_component(name ${file} NAME_WE)
    string(APPEND entries "      {\"${name}\", R\"glsl(${text})glsl\"},\n")
    set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${file})
  endforeach()
  file(CONFIGURE OUTPUT ${output} @ONLY CONTENT [[// Generated from shaders/*.glsl.
#include "@header@"

#include <map>
#include <stdexcept>

namespace @namespace@ {

const std::string& shader(const std::string& name) {
  static const std::map<std::string, std::string> all = {
@entries@  };
  const auto found = all.find(name);
  if (found == all.end()) throw std::logic_error("bocst: there is no shader " + name);
  return found->second;
}

}  // namespace @namespace@
]])
endfunction()
