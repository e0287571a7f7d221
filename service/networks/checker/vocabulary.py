"""The elements and attributes that an upload may use, for each kind of file.

An allow-list: what names a file, includes another one, writes output or reads the environment is not on it, and so is
whatever a later SUMO may bring. The names are those of SUMO 1.28's schemas.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from service.networks.checker import values
from service.networks.checker.values import Type

DOCUMENT = "document"  # what a root element stands in


@dataclass(frozen=True, slots=True)
class Element:
    """Where an element may stand and what it may say."""

    inside: frozenset[str]
    attributes: Mapping[str, Type]
    required: frozenset[str] = field(default_factory=frozenset)


def _by_name(names: Mapping[Type, str]) -> dict[str, Type]:
    return {name: type_ for type_, text in names.items() for name in text.split()}


# What an attribute of this name is wherever it stands, unless the element says otherwise.
_TYPES = _by_name(
    {
        values.IDENTIFIER: "id from to via lane route fromTaz toTaz fromJunction toJunction busStop trainStop "
        "containerStop chargingStation parkingArea edge tl bidi prohibitor prohibited refId vTypes parent",
        values.IDENTIFIERS: "edges nodes incLanes intLanes crossingEdges viaJunctions lines modes",
        values.SHAPE: "shape",
        values.OPTIONAL_SHAPE: "outlineShape",
        values.LABEL: "name value line group",
        values.COLOUR: "color",
        values.COORDINATE: "x y z",
        values.SPEED: "speed maxSpeed desiredMaxSpeed walkSpeed",
        values.LENGTH: "length width height endOffset radius minGap minGapLat sidewalkWidth bikeLaneWidth minWidth "
        "maxWidth contPos visibility posLat",
        values.PROBABILITY: "probability impatience",
        values.NON_NEGATIVE: "friction offset",
        values.number(0, 1e5): "vehsPerHour personsPerHour perHour",
        values.PERIOD: "period",
        values.whole(0, values.MAX_LANE_INDEX): "index fromLane toLane numLanes",
        values.whole(-1, 10_000): "linkIndex linkIndex2 priority layer",
        values.whole(0, 1_000_000): "number",
        values.whole(0, 10_000): "roadsideCapacity personCapacity containerCapacity personNumber containerNumber "
        "repeat lanesCount",
        values.BITS: "response foes",
        values.WORDS: "allow disallow prefer vClasses exceptions changeLeft changeRight type spreadType expected "
        "permitted parkingBadges acceptedBadges discard priorEdges",
        values.EMISSION: "emissionClass",
        values.BOUNDARY: "netOffset convBoundary origBoundary center",
        values.PROJECTION: "projParameter",
    }
)


def _element(inside: str, names: str, *, required: str = "", **special: Type) -> Element:
    """An element; names without a type of their own are words or numbers."""
    attributes = {name: _TYPES.get(name, values.WORD) for name in (*names.split(), *required.split())}
    return Element(frozenset(inside.split()), attributes | special, frozenset(required.split()))


def _traffic_light(parent: str) -> Element:
    return _element(
        parent,
        "offset",
        required="id type programID",
        type=values.SIGNAL_PROGRAM,
        offset=values.FINITE,
        programID=values.IDENTIFIER,
    )


_PARAM_KEYS = {"key": values.PARAMETER_KEY, "value": values.LABEL}
_PHASE = _element(
    "tlLogic",
    "minDur maxDur earliestEnd latestEnd earlyTarget finalTarget yellow red vehext next name",
    required="duration state",
    state=values.SIGNALS,
    duration=values.NON_NEGATIVE,
    next=values.WORDS,
)

NET = {
    "net": _element(
        DOCUMENT,
        "version junctionCornerDetail junctionLinkDetail lefthand rectangularLaneCut walkingareas limitTurnSpeed "
        "checkLaneFoesAll checkLaneFoesRoundabout tlsIgnoreInternalJunctionJam spreadType avoidOverlap "
        "junctionHigherSpeed internalJunctionsVehicleWidth junctionsMinimalShape junctionsEndpointShape",
    ),
    "location": _element("net", "netOffset convBoundary origBoundary projParameter"),
    "type": _element(
        "net",
        "priority numLanes speed friction allow disallow discard oneway width widthResolution maxWidth minWidth "
        "sidewalkWidth bikeLaneWidth spreadType",
        required="id",
        sidewalkWidth=values.FINITE,  # -1: none
        bikeLaneWidth=values.FINITE,
        width=values.FINITE,
        maxWidth=values.FINITE,
        minWidth=values.FINITE,
        widthResolution=values.FINITE,
    ),
    "restriction": _element("type", "vClass speed"),
    "edge": _element(
        "net",
        "from to function name priority length bidi type routingType shape distance spreadType crossingEdges",
        required="id",
        type=values.LABEL,
        routingType=values.LABEL,
        distance=values.FINITE,
    ),
    "lane": _element(
        "edge",
        "allow disallow prefer friction endOffset width acceleration customShape type changeRight changeLeft "
        "outlineShape",
        required="id index speed length shape",
        type=values.LABEL,
    ),
    "neigh": _element("lane", "", required="lane"),
    "stopOffset": _element("edge lane", "vClasses exceptions", required="value", value=values.LENGTH),
    "tlLogic": _traffic_light("net"),
    "phase": _PHASE,
    "junction": _element(
        "net",
        "z shape name radius customShape rightOfWay fringe roundabout",
        required="id type x y incLanes intLanes",
        shape=values.OPTIONAL_SHAPE,
    ),
    "request": _element("junction", "cont", required="index response foes", index=values.whole(0, 4000)),
    "connection": _element(
        "net",
        "pass keepClear contPos visibility allow disallow speed length shape uncontrolled via tl linkIndex linkIndex2 "
        "changeRight changeLeft indirect type dir state",
        required="from to fromLane toLane",
        speed=values.FINITE,  # -1: not set
        length=values.FINITE,
        contPos=values.FINITE,
        visibility=values.FINITE,
        type=values.LABEL,
        dir=values.LINK_LETTER,
        state=values.LINK_LETTER,
    ),
    "prohibition": _element(
        "net", "", required="prohibitor prohibited", prohibitor=values.LABEL, prohibited=values.LABEL
    ),
    "roundabout": _element("net", "", required="nodes edges"),
    "param": _element("net edge lane junction connection", "", required="key value", **_PARAM_KEYS),
}

# Without imgFile and osgFile.
_VEHICLE_TYPE = """
    length minGap maxSpeed desiredMaxSpeed probability speedFactor speedDev vClass emissionClass maneuverAngleTimes
    guiShape width height mass color accel decel emergencyDecel apparentDecel maxAccelProfile desAccelProfile
    parkingBadges personCapacity containerCapacity boardingDuration loadingDuration scale lcStrategic lcCooperative
    lcSpeedGain lcKeepRight lcSublane lcOpposite lcPushy lcPushyGap lcStrategicLookahead lcAssertive lcLookaheadLeft
    lcSpeedGainRight lcSpeedGainLookahead lcSpeedGainRemainTime lcSpeedGainUrgency lcCooperativeRoundabout
    lcCooperativeSpeed lcCooperativeHelpTime lcCooperativeHelpThreshold lcCooperativeMinSpeed lcTurnAlignmentDistance
    lcImpatience lcTimeToImpatience lcAccelLat lcMaxSpeedLatStanding lcMaxSpeedLatFactor lcMaxDistLatStanding
    lcOvertakeRight lcLaneDiscipline lcSigma lcKeepRightAcceptanceTime lcOvertakeDeltaSpeedFactor lcContRight
    maxSpeedLat latAlignment actionStepLength minGapLat jmCrossingGap jmDriveAfterYellowTime jmDriveAfterRedTime
    jmDriveRedSpeed jmIgnoreKeepClearTime jmIgnoreFoeSpeed jmIgnoreFoeProb jmIgnoreJunctionFoeProb jmSigmaMinor
    jmStoplineGap jmStoplineGapMinor jmTimegapMinor jmExtraGap jmAdvance jmStopSignWait jmAllwayStopWait sigma
    sigmaStep impatience tau delta stepping adaptTime adaptFactor tmp1 tmp2 tmp3 tmp4 tmp5 tauLast apProb k phi
    security estimation speedControlGain speedControlMinGap gapClosingControlGainSpeed gapClosingControlGainSpace
    gapControlGainSpeed gapControlGainSpace collisionAvoidanceGainSpeed collisionAvoidanceGainSpace
    collisionAvoidanceOverride tauCACCToACC carFollowModel trainType laneChangeModel cc1 cc2 cc3 cc4 cc5 cc6 cc7 cc8
    cc9 collisionMinGapFactor speedControlGainCACC gapClosingControlGainGap gapClosingControlGainGapDot
    gapControlGainGap gapControlGainGapDot collisionAvoidanceGainGap collisionAvoidanceGainGapDot tPersDrive tpreview
    treaction tPersEstimate ccoolness sigmaleader sigmagap sigmaerror jerkmax epsilonacc taccmax Mflatness Mbegin
    vehdynamics maxvehpreview startupDelay timeToTeleport timeToTeleportBidi speedFactorPremature boardingFactor
    massFactor
"""
_DEPARTURE = """
    departLane departPos departSpeed departEdge arrivalEdge arrivalLane arrivalPos arrivalSpeed departPosLat
    arrivalPosLat line personNumber containerNumber speedFactor parkingBadges insertionChecks color reroute
"""
_JOURNEY = "route from to via fromTaz toTaz fromJunction toJunction viaJunctions type"
_PLACES = "busStop trainStop parkingArea containerStop chargingStation"
_ROADSIDE = "name color startPos endPos angle friendlyPos lines parkingLength"
_TRAVELLERS = "vehicle flow trip"
_VIA = {"via": values.IDENTIFIERS}  # edges, where a connection has one lane


def _demand(root: str) -> dict[str, Element]:
    """What moves on the roads; route and additional files have it in common."""
    return {
        root: _element(DOCUMENT, ""),
        "vType": _element(
            f"{root} vTypeDistribution",
            _VEHICLE_TYPE,
            required="id",
            speedFactor=values.DISTRIBUTION,
            maneuverAngleTimes=values.WORDS,
            maxAccelProfile=values.WORDS,
            desAccelProfile=values.WORDS,
        ),
        "vTypeDistribution": _element(
            root, "vTypes probabilities", required="id", vTypes=values.IDENTIFIERS, probabilities=values.WORDS
        ),
        "route": _element(
            f"{root} routeDistribution vehicle flow",
            "id edges color cost repeat cycleTime probability",
        ),
        "routeDistribution": _element(f"{root} vehicle flow", "id last"),
        "vehicle": _element(root, _JOURNEY + _DEPARTURE, required="id depart", **_VIA),
        "trip": _element(root, _JOURNEY + _DEPARTURE, required="id depart", **_VIA),
        "flow": _element(
            root,
            f"{_JOURNEY} {_DEPARTURE} begin end period vehsPerHour perHour probability number",
            required="id",
            **_VIA,
        ),
        "stop": _element(
            f"route person personFlow {_TRAVELLERS}",
            f"lane edge {_PLACES} startPos endPos posLat friendlyPos duration until extension index parking triggered "
            "expected permitted actType speed jump onDemand",
            posLat=values.FINITE,
            index=values.WORD,
            actType=values.LABEL,
        ),
        "person": _element(root, "type departPos color speedFactor", required="id depart"),
        "personFlow": _element(
            root,
            "type departPos color speedFactor begin end period vehsPerHour personsPerHour perHour probability number",
            required="id",
        ),
        "walk": _element(
            "person personFlow",
            f"route edges from to fromTaz toTaz fromJunction toJunction {_PLACES} speed duration departPos "
            "departPosLat departLane arrivalPos",
        ),
        "ride": _element("person personFlow", f"from to {_PLACES} lines arrivalPos group intended depart"),
        "personTrip": _element(
            "person personFlow",
            f"from to fromJunction toJunction {_PLACES} modes vTypes departPos arrivalPos walkFactor group lines",
            vTypes=values.IDENTIFIERS,
        ),
    }


ROUTES = _demand("routes")
ADDITIONAL = _demand("additional") | {
    "tlLogic": _traffic_light("additional"),
    "phase": _PHASE,
    "busStop": _element("additional", f"{_ROADSIDE} personCapacity", required="id lane"),
    "trainStop": _element("additional", f"{_ROADSIDE} personCapacity", required="id lane"),
    "containerStop": _element("additional", f"{_ROADSIDE} containerCapacity", required="id lane"),
    "chargingStation": _element(
        "additional",
        f"{_ROADSIDE} power efficiency chargeInTransit chargeDelay",
        required="id lane",
    ),
    "access": _element("busStop trainStop containerStop", "pos friendlyPos length", required="lane"),
    "parkingArea": _element(
        "additional",
        f"{_ROADSIDE} roadsideCapacity onRoad width length departPos lefthand acceptedBadges",
        required="id lane",
    ),
    "space": _element("parkingArea", "z name width length angle slope", required="x y"),
    "poly": _element(
        "additional",
        "type color fill geo layer angle lineWidth name height",
        required="id shape",
        type=values.LABEL,
        layer=values.FINITE,
    ),
    "poi": _element(
        "additional",
        "icon type color layer x y lane pos friendlyPos posLat angle width height name",
        required="id",
        type=values.LABEL,
        layer=values.FINITE,
        posLat=values.FINITE,
    ),
    "taz": _element("additional", "edges shape center fill color name", required="id"),
    "tazSource": _element("taz", "weight", required="id"),
    "tazSink": _element("taz", "weight", required="id"),
    "param": _element("poly poi", "", required="key value", **_PARAM_KEYS),
}
VOCABULARIES: Mapping[str, Mapping[str, Element]] = {"net": NET, "routes": ROUTES, "additional": ADDITIONAL}
