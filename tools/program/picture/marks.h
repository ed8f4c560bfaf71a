// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cairo.h>

#include <vector>

#include "mesh/health.h"
#include "pairs/query_pair.h"
#include "render/renderer.h"

namespace bocst::program {

constexpr render::Color kContactColor = {0.80f, 0.0f, 0.28f};

constexpr render::Color kFaultColor = {0.85f, 0.0f, 0.1f};

/// How long the arrow of a normal is, of the view's radius.
constexpr double kNormalLength = 0.22;

/// Contacts as dots over a square view of `side` pixels; with normals, arrows along them from as many as have room,
/// which all start at a contact. Nothing hides them.
void markContacts(cairo_t* pen, const std::vector<TouchingPoint>& contacts, const render::View& view, int side,
                  bool normals);

/// Faulty edges and triangles as lines. Nothing hides them.
void markFaults(cairo_t* pen, const Faults& faults, const Mesh& mesh, const render::View& view, int side);

/// What the second view shows, as a square in the first.
void markFrame(cairo_t* pen, const render::View& all, const render::View& near, int side);

}  // namespace bocst::program
