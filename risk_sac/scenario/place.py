"""Places of patterns on a net: plain data that a finder derives from it.

The finders are in `risk_sac.maps`. The places of the shipped families lie beside their nets, in `sumo_nets/`.
A place names edges; patterns never do.
"""

from typing import Annotated, Literal

from pydantic import Field, TypeAdapter

from risk_sac.config import Settings

Corners = tuple[tuple[float, float], ...]
Word = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]{0,39}$")]
Name = Annotated[str, Field(min_length=1, max_length=200)]


class Piece(Settings):
    """A lane on the way to a reference, such as a stop line, or beyond it."""

    edge: Name
    lane: int
    """Index on its edge; 0 is the rightmost."""
    reach_m: float
    """From the beginning of the lane to the reference; negative beyond it."""
    length_m: float
    limit_mps: float


class Track(Settings):
    """A way through the net on which vehicles start, lane by lane."""

    pieces: Annotated[tuple[Piece, ...], Field(min_length=1)]
    """In the order in which they are driven; those inside junctions are left out."""
    onward: tuple[Name, ...] = ()
    """Edges that follow the last piece."""

    @property
    def room_m(self) -> float:
        """Length of the track before its reference, m."""
        return self.pieces[0].reach_m

    def start(self, before_m: float, lead_m: float = 0.0) -> tuple[tuple[str, ...], Piece, float]:
        """Route, lane, and position on it of a front bumper `before_m`, and `lead_m` more, before the reference.

        A vehicle that would start inside a junction starts at its entry.
        """
        first = len(self.pieces) - 1
        while first > 0 and self.pieces[first].reach_m - before_m - lead_m < 0.0:
            first -= 1
        piece = self.pieces[first]
        position_m = min(max(piece.reach_m - before_m - lead_m, 0.0), piece.length_m)
        return tuple(each.edge for each in self.pieces[first:]) + self.onward, piece, position_m


class Walk(Settings):
    """Start of a pedestrian's walk, off the kerb."""

    x_m: float
    y_m: float
    along_x: float
    """Unit vector across the road."""
    along_y: float


class PlaceGround(Settings):
    """The ground around a place, as convex polygons with their corners counter-clockwise."""

    crossings: tuple[Corners, ...] = ()
    roadway: tuple[Corners, ...] = ()
    """As far as pedestrians may get there."""
    junctions: tuple[Corners, ...] = ()


class FixedSignal(Settings):
    """A traffic light with a fixed programme."""

    id: Name
    cycle_s: Annotated[float, Field(gt=0)]


class Leg(Settings):
    """A road that leads to a junction."""

    name: Word
    """What the vehicle on it is called."""
    speed_limit_mps: float
    turns: Annotated[tuple[Track, ...], Field(min_length=1)]
    """By where they lead, from left to right; the reference is the stop line."""


class Stream(Settings):
    """Traffic that SUMO drives."""

    name: Word
    track: Track


class Site(Settings):
    """A crossing and the roads that lead to it; the reference is its near edge."""

    signalised: bool
    ego: Track
    occluder: Track
    """Beside the ego's lane, on the side from which the pedestrian comes."""
    beyond: bool = False
    """Whether the occluder comes the other way and is beyond the crossing: its reference is the crossing's far edge."""
    oncoming: tuple[Track, ...] = ()
    walk: Walk


class _Somewhere(Settings):
    net: str
    """The file that SUMO loads: below `sumo_nets/`, or anywhere."""
    summary: str
    lanes: int
    """Of the ego's road, in its direction."""
    speed_limit_mps: float
    lane_width_m: float
    signal: FixedSignal | None = None
    ground: PlaceGround = PlaceGround()
    wary: bool = False
    """Whether drivers stop for an ego that stands askew; not so where the shipped families are, whose results stay."""

    @property
    def plain_summary(self) -> str:
        """The summary as people read it."""
        return self.summary


class Stretch(_Somewhere):
    """A road where the ego follows a leader; the reference is the ego's start."""

    pattern: Literal["car_following"] = "car_following"
    ego: Track
    left: Track | None = None
    right: Track | None = None

    @property
    def plain_summary(self) -> str:
        """The summary as people read it; the stored words stay, since the place's name has their digest."""
        head, found, _ = self.summary.partition(": who is ahead")
        sides = [name for name, track in (("left", self.left), ("right", self.right)) if track]
        if not found:
            return self.summary
        if not sides:
            return f"{head}: the vehicle ahead brakes and adapts its speed."
        beside = "those on the left and right" if len(sides) > 1 else f"the one on the {sides[0]}"
        return f"{head}: the vehicle ahead and {beside} brake, adapt their speed and cut in."


class CrossingPlace(_Somewhere):
    """One crossing, or an unsignalised and a signalised one on the same net."""

    pattern: Literal["crossing"] = "crossing"
    sites: Annotated[tuple[Site, ...], Field(min_length=1, max_length=2)]


class JunctionPlace(_Somewhere):
    """A junction as it is approached from one of its roads."""

    pattern: Literal["junction"] = "junction"
    ego: Leg
    others: Annotated[tuple[Leg, ...], Field(min_length=1)]
    """With ways that the ego's cross or join."""
    streams: tuple[Stream, ...] = ()
    walk: Walk | None = None


Place = Annotated[Stretch | CrossingPlace | JunctionPlace, Field(discriminator="pattern")]
PLACES: TypeAdapter[Place] = TypeAdapter(Place)
