#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
#
# exports.sh LIBRARY: libbocst shows its own names, and of FCL's only the entry points, tables and types of exports.map.
set -euo pipefail

names=$(nm -DC --defined-only "$1" | cut -d' ' -f3-)
own='^(typeinfo (name )?for |vtable for )?bocst::|^[a-z:<> ]*bocst::(collide|distance|isModel|fcl_adapter::continuousPair)<|^(float|double|unsigned long|bool|void) bocst::'
fcl='^(unsigned long|float|double|fcl::detail::GJKSolver_[a-z]*<[a-z]*>::S) fcl::(collide|distance|continuousCollide|(detail::)?continuousCollideConservativeAdvancement)<'
tables='^(guard variable for )?fcl::get(Collision|Distance|ConservativeAdvancement)FunctionLookTable<.*::table$|^fcl::detail::[A-Za-z]*FunctionMatrix<.*>& fcl::get(Collision|Distance|ConservativeAdvancement)FunctionLookTable<.*>\(\)$'
types='^(typeinfo for|typeinfo name for|vtable for) fcl::(CollisionGeometry|ShapeBase|TriangleP|[A-Za-z]*Motion|MotionBase)<'
unexpected=$(grep -vE "$own|$fcl|$tables|$types" <<< "$names" || true)
[[ -z $unexpected ]] || { printf 'FAILED: it shows\n%s\n' "$(head -20 <<< "$unexpected")"; exit 1; }
for entry in 'fcl::collide<float>(fcl::CollisionGeometry' 'fcl::collide<double, fcl::detail::GJKSolver_libccd' \
  'fcl::collide<double, fcl::detail::GJKSolver_indep' 'fcl::distance<double>(fcl::CollisionObject' \
  'fcl::continuousCollide<double>(fcl::CollisionGeometry' 'FunctionLookTable' \
  'fcl::detail::continuousCollideConservativeAdvancement<fcl::detail::GJKSolver_libccd<double>' 'bocst::Model<double>::prune' \
  'typeinfo for bocst::OracleError'; do
  grep -qF "$entry" <<< "$names" || { echo "FAILED: it does not show $entry"; exit 1; }
done
echo "$(wc -l <<< "$names") names, $(grep -cE "$fcl|$tables|$types" <<< "$names") of them FCL's"
