"""In the checkers' environment: the middles of all lanes of an OpenDRIVE file as ASAM's reader has them, as JSON."""

import json
import sys

from lxml import etree
from qc_opendrive.base import utils

STEPS = 60
lines = []
for road in utils.get_roads(etree.parse(sys.argv[1]).getroot()):
    length = utils.get_road_length(road)
    for section in utils.get_lane_sections(road):
        for lane in utils.get_left_and_right_lanes_from_lane_section(section):
            stations = [min(length * k / STEPS, length - 1e-9) for k in range(STEPS + 1)]
            at = [utils.get_middle_point_xyz_at_height_zero_from_lane_by_s(road, section, lane, s) for s in stations]
            lines.append([(point.x, point.y) for point in at])
print(json.dumps(lines))
