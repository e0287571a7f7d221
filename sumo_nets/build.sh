#!/bin/sh
# Rebuilds every <family>/<family>.net.xml from its plain XML sources. Needs netconvert (wheel: eclipse-sumo).
set -eu
cd "$(dirname "$0")"
for family in low mixed dense; do
    connections=""
    [ -f "$family/$family.con.xml" ] && connections="--connection-files $family/$family.con.xml"
    # shellcheck disable=SC2086
    netconvert --node-files "$family/$family.nod.xml" --edge-files "$family/$family.edg.xml" $connections \
        --output-file "$family/$family.net.xml" --no-turnarounds true --offset.disable-normalization true \
        --walkingareas true --tls.default-type static --tls.green.time 25 --tls.yellow.time 3 \
        --output.original-names false --junctions.scurve-stretch 1 --junctions.internal-link-detail 20 --write-license false
    # The header carries a date and the machine's paths; drop it, so that a rebuild gives the same file.
    sed '/^<!--/,/-->$/d' "$family/$family.net.xml" >"$family/$family.net.xml.tmp"
    mv "$family/$family.net.xml.tmp" "$family/$family.net.xml"
done
