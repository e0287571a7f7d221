"""What an uploaded network may be and what its check may cost, in one place."""

MAX_EXPANDED_BYTES = 64 << 20  # of all documents together, once unpacked
MAX_RATIO = 100  # bytes unpacked per byte sent; SUMO's nets reach 10 to 20
RATIO_FREE_BYTES = 1 << 20  # so little may be packed as tightly as it likes
MAX_FILES = 20  # in an archive
MAX_NAME = 200  # characters of an id, or of a file's name

MAX_DEPTH = 8  # of nested elements; SUMO's files reach 4
MAX_ELEMENTS = 300_000  # of all documents together
MAX_FOREIGN_ELEMENTS = 1_000_000  # of a map that is converted: of a town, most are houses
MAX_FOREIGN_DEPTH = 20
MAX_ATTRIBUTES = 100  # of one element
MAX_VALUE = 100_000  # characters of one attribute: a shape of 4,000 points
MAX_EDGES = 50_000  # those inside junctions included
MAX_LANES = 64  # of one edge
MAX_COORDINATE = 1e7  # m; the Earth's circumference is 4e7
MAX_NUMBER = 1e9  # of anything else

CPU_S = 20  # a town of 1,000 junctions takes 2 to 3
WALL_S = 20
MEMORY_BYTES = 2 << 30  # of address space; Python with an idle libsumo takes 0.9 GiB
LOG_BYTES = 64 << 10  # what the simulator may write to its log, and to any other file
OPEN_FILES = 64
SURVEY_S = 60  # that a search for places may take, in wall-clock and in processor time
SURVEY_MEMORY_BYTES = 3 << 30
MAX_PLACES = 100  # of a campaign
STEPS, STEP_S = 3, 0.1  # that the simulator runs
MAX_VEHICLES = 1000  # that it inserts meanwhile
