#!/usr/bin/env bash
# Adjust every strip of a folder and compare it with its baseline: for any CI server, and for a cron job.
#
#   regress.sh [STRIPS [OUT]]         STRIPS/*/project.yaml with baseline.json beside it; results go to OUT (default build)
#
# PHOTOSTRIP  the command                      (default photostrip)
# TOLERANCES  a tolerance profile              (default: the last digits)
# STRICT      not empty: a verdict other than GOOD is an error, too
# FORMAT      text; md, json; github for annotations; junit, as in compare.xml  (default text)
#
# OUT/NAME/compare.xml is JUnit for the server's table of tests. All strips are done; the exit code is the worst of
# them: 0 all agree; 1 a tolerance failed, a result differs, or STRICT and a verdict that is not GOOD; 2 faults in files; 3 a geometry is too weak.
set -uo pipefail

strips=${1:-.} out=${2:-build}
photostrip=${PHOTOSTRIP:-photostrip} format=${FORMAT:-text} strict=${STRICT:+--strict}
worst=0

keep_worst() { [ "$1" -le "$worst" ] || worst=$1; }

one_strip() {
    local name=$1 code=0 where=$strips/$1
    [ "$format" != text ] || printf '== %s\n' "$name"
    local run=("$where/project.yaml" -o "$out/$name" --quiet $strict)
    if [ "$format" = junit ]; then # of comparisons only: the verdict goes to stderr
        $photostrip run "${run[@]}" --format text >&2 || code=$?
    else
        $photostrip run "${run[@]}" --format "$format" || code=$?
    fi
    keep_worst "$code"
    [ "$code" -le 1 ] && [ -e "$where/baseline.json" ] || return 0
    local compare=("$out/$name" "$where/baseline.json" --quiet)
    [ -z "${TOLERANCES:-}" ] || compare+=(--tol "$TOLERANCES")
    $photostrip compare "${compare[@]}" --format junit > "$out/$name/compare.xml"
    $photostrip compare "${compare[@]}" --format "$format"
    keep_worst $?
}

found=0
for project in "$strips"/*/project.yaml; do
    [ -e "$project" ] || continue
    found=$((found + 1))
    one_strip "$(basename "$(dirname "$project")")"
done
[ "$found" -gt 0 ] || { echo "no $strips/*/project.yaml" >&2; exit 2; }
exit "$worst"
