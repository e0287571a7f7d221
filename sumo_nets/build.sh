#!/bin/sh
# Rebuilds every <net>/<net>.net.xml from its plain XML sources. Needs netconvert (wheel: eclipse-sumo).
set -eu
cd "$(dirname "$0")"
for nodes in */*.nod.xml; do
    net="${nodes%.nod.xml}"
    connections=""
    [ -f "$net.con.xml" ] && connections="--connection-files $net.con.xml"
    # shellcheck disable=SC2086
    netconvert --node-files "$net.nod.xml" --edge-files "$net.edg.xml" $connections \
        --output-file "$net.net.xml" --no-turnarounds true --offset.disable-normalization true \
        --walkingareas true --tls.default-type static --tls.green.time 25 --tls.yellow.time 3 \
        --output.original-names false --junctions.scurve-stretch 1 --junctions.internal-link-detail 20 --write-license false
    # The header carries a date and the machine's paths; drop it, so that a rebuild gives the same file.
    sed '/^<!--/,/-->$/d' "$net.net.xml" >"$net.net.xml.tmp"
    mv "$net.net.xml.tmp" "$net.net.xml"
done
