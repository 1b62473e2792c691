"""Ways held against envelopes; what hypothesis makes is held against brute force."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mavproxy_uavapi.core.airspace.local_frame import LocalFrame, Spot, rows, to_leg
from mavproxy_uavapi.core.airspace.model import Area, Envelope, EnvelopeLimits
from mavproxy_uavapi.core.airspace.prisms import Rule
from mavproxy_uavapi.core.airspace.space import TOUCH, Space, outside_by
from mavproxy_uavapi.core.errors import Invalid
from mavproxy_uavapi.core.geodesy import METRES_PER_DEGREE, offset

HOME = (-35.363261, 149.165230)
FRAME = LocalFrame(HOME)
POINT = st.builds(Spot, st.floats(-90, 90), st.floats(-90, 90), st.floats(0, 40))
SAMPLES = 30  # points of a way that brute force looks at


def corner(north: float, east: float) -> tuple[float, float]:
    return FRAME.degrees(Spot(north, east, 0.0))


def square(half: float, *, north: float = 0.0, east: float = 0.0, name: str = "field", **changes) -> Area:
    ring = [(north + n * half, east + e * half) for n, e in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    return Area(**{"name": name, "inclusion": True, "rings": (tuple(corner(*c) for c in ring),), **changes})


def breach(space: Space, *spots: tuple[float, float, float], home=(0.0, 0.0), **options):
    frame = space.frame(HOME)
    home_spot = frame.spot(FRAME.degrees(Spot(*home, 0.0)), 0.0)
    way = [frame.spot(FRAME.degrees(Spot(*spot)), spot[2]) for spot in spots]
    return space.breach(way, space.rules(home_spot[:2]), **options)


def test_an_outline_that_crosses_itself_is_refused_where_it_does_in_degrees() -> None:
    bow = tuple(corner(*c) for c in ((0, 0), (100, 100), (0, 100), (100, 0)))
    with pytest.raises(Invalid, match=r"field is no area: its outline crosses .* near -35\.362812, 149\.165781$"):
        Space(Envelope((Area("field", True, (bow,)),)))


def test_a_hole_outside_of_its_outline_is_refused_where_it_lies() -> None:
    (ring,), (hole,) = square(50).rings, square(5, east=200).rings
    with pytest.raises(Invalid, match=r"field is no area: its holes lie outside or in each other near -35\.36"):
        Space(Envelope((Area("field", True, (ring, hole)),)))


def test_way_inside_breaks_nothing() -> None:
    space = Space(Envelope((square(100, floor=2, ceiling=50),)))
    assert breach(space, (0, 0, 10), (90, -90, 49)) is None
    assert breach(space, (0, 0, 10)) is None


@pytest.mark.parametrize("number", [math.nan, math.inf])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_place_that_is_no_number_breaks_it(number: float, axis: int) -> None:
    space = Space(Envelope((square(100, floor=2, ceiling=50),)))
    spot = [0.0, 0.0, 10.0]
    spot[axis] = number
    assert space.breach([Spot(0.0, 0.0, 10.0), Spot(*spot)], space.rules((0.0, 0.0))) is not None


def test_target_outside_is_named_with_where_and_by_how_much() -> None:
    violation = breach(Space(Envelope((square(100),))), (0, 0, 10), (130, 0, 10))
    assert violation.what == "field"
    assert violation.by == pytest.approx(30.0, abs=0.01)


def test_way_over_a_ceiling_and_under_a_floor_breaks_it() -> None:
    space = Space(Envelope((square(100, floor=5, ceiling=50),)))
    assert breach(space, (0, 0, 10), (0, 0, 53.0)).by == pytest.approx(3.0)
    assert breach(space, (0, 0, 10), (50, 0, 1.0)).by == pytest.approx(4.0)


def test_way_through_an_exclusion_breaks_it_with_both_ends_outside() -> None:
    space = Space(Envelope((square(100), square(10, name="mast", inclusion=False, ceiling=40))))
    assert breach(space, (-50, 0, 10), (50, 0, 10)).what == "mast"
    assert breach(space, (-50, 0, 10), (50, 0, 10)).by == pytest.approx(10.0, abs=0.1)
    assert breach(space, (-50, 0, 45), (50, 0, 45)) is None
    assert breach(space, (-50, 0, 10), (0, 50, 10)) is None


def test_way_through_the_bay_of_a_polygon_that_is_not_convex_breaks_it() -> None:
    ring = tuple(corner(*c) for c in ((0, 0), (100, 0), (100, 100), (50, 50), (0, 100)))
    space = Space(Envelope((Area("L", inclusion=True, rings=(ring,)),)))
    assert breach(space, (90, 85, 10), (10, 85, 10)).what == "L"
    assert breach(space, (90, 40, 10), (10, 40, 10)) is None


def test_touching_inclusions_are_one_field_unless_it_must_be_in_every_one() -> None:
    areas = square(50, name="west", east=-50), square(50, name="east", east=50)
    assert breach(Space(Envelope(areas)), (0, -90, 10), (0, 90, 10)) is None
    assert breach(Space(Envelope(areas, every=True)), (0, -90, 10), (0, 90, 10)) is not None


def test_hole_of_a_polygon_is_outside() -> None:
    outline, hole = square(100).rings[0], square(10).rings[0]
    space = Space(Envelope((Area("ring", inclusion=True, rings=(outline, hole)),)))
    assert breach(space, (-50, 0, 10), (50, 0, 10)).by == pytest.approx(10.0, abs=0.1)


def test_way_back_inside_is_allowed_only_if_it_does_not_leave_again() -> None:
    space = Space(Envelope((square(100), square(10, name="mast", inclusion=False))))
    assert breach(space, (150, 50, 10), (50, 50, 10)) is None
    assert breach(space, (150, 50, 10), (140, 50, 10)) is not None
    assert breach(space, (150, 0, 10), (-50, 0, 10)).what == "mast"
    assert breach(space, (150, 50, 10), (-150, 50, 10)) is not None
    assert breach(space, (150, 50, 10), (50, 50, 10), may_return=False) is not None


def test_circles_err_to_the_safe_side_by_less_than_a_thousandth() -> None:
    within = Space(Envelope((Area("in", inclusion=True, centre=HOME, radius=1000.0),)))
    without = Space(Envelope((Area("out", inclusion=False, centre=HOME, radius=1000.0),)))
    for degrees in range(0, 360, 7):
        n, e = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        assert breach(within, (1000.1 * n, 1000.1 * e, 10)) is not None
        assert breach(within, (999 * n, 999 * e, 10)) is None
        assert breach(without, (999.9 * n, 999.9 * e, 10)) is not None
        assert breach(without, (1001 * n, 1001 * e, 10)) is None


def test_limits_count_from_home_without_any_area() -> None:
    space = Space(Envelope(limits=EnvelopeLimits(height=50, distance=100)))
    assert breach(space, (0, 0, 10), (90, 0, 40)) is None
    assert breach(space, (0, 0, 10), (0, 0, 60)).what == "the highest height"
    assert breach(space, (0, 0, 10), (0, 110, 40)).by == pytest.approx(10, abs=0.1)
    assert breach(space, (0, 0, 10), (0, 110, 40), home=(0, 50)) is None


def test_a_vehicle_that_circles_keeps_its_radius_from_every_border() -> None:
    space = Space(Envelope((square(100), square(10, name="mast", inclusion=False, east=-60))))
    frame = space.frame(HOME)
    rules = space.rules(None, 30.0)
    spot = lambda north, east: frame.spot(corner(north, east), 10.0)  # noqa: E731
    assert space.breach([spot(0, 0), spot(60, 60)], rules) is None
    assert space.breach([spot(0, 0), spot(75, 60)], rules) is not None
    assert space.breach([spot(0, 0), spot(0, -25)], rules).what == "mast"
    nothing_left = space.rules(None, 200.0)
    assert space.breach([spot(0, 0)], nothing_left).by == math.inf


def test_rover_has_no_floor_nor_ceiling_and_passes_under_what_is_above() -> None:
    over = square(10, name="airway", inclusion=False, floor=30, north=50)
    space = Space(Envelope((square(100, floor=5, ceiling=50), over)))
    rules = space.rules(None, on_ground=True)
    way = [space.frame(HOME).spot(corner(north, 0), 0.0) for north in (0, 90)]
    assert space.breach(way, rules) is None


@pytest.mark.parametrize(
    "area",
    [
        square(10, rings=((corner(0, 0), corner(10, 10), corner(0, 10), corner(10, 0)),)),
        square(10, rings=((corner(0, 0), corner(10, 10)),)),
        square(10, rings=((corner(0, 0), corner(10, 10), corner(20, 20)),)),
        square(10, rings=((corner(0, 0), corner(0, 90_000), corner(90_000, 0)),)),
        square(10, floor=10.0, ceiling=10.0),
        square(10, floor=math.nan),
        Area("bad", inclusion=True, centre=HOME, radius=0.0),
        Area("bad", inclusion=True, centre=(89.0, 0.0), radius=10.0),
        Area("bad", inclusion=True, centre=(math.nan, 0.0), radius=10.0),
        Area("bad", inclusion=True),
    ],
)
def test_area_that_makes_no_sense_is_refused(area: Area) -> None:
    with pytest.raises(Invalid):
        Space(Envelope((area,)))


def test_envelope_across_the_date_line_is_one() -> None:
    ring = ((-17.0, 179.999), (-17.001, -179.999), (-16.999, -179.999))
    space = Space(Envelope((Area("line", inclusion=True, rings=(ring,)),)))
    frame = space.frame(ring[0])
    way = [frame.spot(place, 10.0) for place in ((-17.0, 179.9999), (-17.0, -179.9995))]
    assert space.breach(way, space.rules(None)) is None
    assert frame.degrees(frame.spot((-17.0, -179.9995), 0.0)) == pytest.approx((-17.0, -179.9995))


@settings(max_examples=50, derandomize=True, database=None, deadline=None)
@given(
    lat=st.floats(-60, 60), north=st.floats(-5000, 5000), east=st.floats(-5000, 5000), other=st.floats(-5000, 5000)
)
def test_metres_err_by_less_than_the_stated_bound(lat: float, north: float, east: float, other: float) -> None:
    frame = LocalFrame((lat, 10.0))
    a, b = frame.degrees(Spot(north, east, 0)), frame.degrees(Spot(north, east + other, 0))
    true = offset(*a, *b)[1]
    n = abs(north) / (METRES_PER_DEGREE * 180 / math.pi)
    assert abs(true - other) <= 1.01 * abs(other) * (math.tan(math.radians(abs(lat))) * n + n * n / 2) + 1e-6


# -- brute force --------------------------------------------------------------------------------------------------


def naively_inside(spot: Spot, ring: list[tuple[float, float]]) -> bool:
    """A ray to the east crosses an odd number of sides."""
    inside = False
    for (n1, e1), (n2, e2) in zip(ring, [*ring[1:], ring[0]], strict=True):
        if (n1 > spot.north) != (n2 > spot.north):
            inside ^= spot.east < e1 + (e2 - e1) * (spot.north - n1) / (n2 - n1)
    return inside


def naively_to_border(spot: Spot, ring: list[tuple[float, float]]) -> float:
    """Metres over the ground."""
    corners = [Spot(*corner, spot.up) for corner in ring]
    return min(to_leg(spot, a, b) for a, b in zip(corners, [*corners[1:], corners[0]], strict=True))


METRES = st.floats(-120, 120, allow_nan=False)
HEIGHTS = st.floats(0, 100, allow_nan=False)
STARS = st.lists(st.floats(20, 100), min_size=3, max_size=9)  # distances of corners from a middle, all around it


def star(reaches: list[float], north: float, east: float) -> list[tuple[float, float]]:
    angles = [2 * math.pi * number / len(reaches) for number in range(len(reaches))]
    return [(north + r * math.cos(a), east + r * math.sin(a)) for r, a in zip(reaches, angles, strict=True)]


@settings(max_examples=100, deadline=None, database=None, derandomize=True)
@given(
    field=STARS,
    hole=STARS,
    at=st.tuples(METRES, METRES),
    floor=st.floats(-5, 40),
    thick=st.floats(5, 60),
    a=st.tuples(METRES, METRES, HEIGHTS),
    b=st.tuples(METRES, METRES, HEIGHTS),
)
def test_way_is_judged_as_brute_force_judges_it(field, hole, at, floor, thick, a, b) -> None:
    inclusion, exclusion = star(field, 0, 0), star([r / 4 for r in hole], *at)
    areas = (
        Area("field", inclusion=True, rings=(tuple(corner(*c) for c in inclusion),), ceiling=80.0),
        Area("hole", False, (tuple(corner(*c) for c in exclusion),), floor=floor, ceiling=floor + thick),
    )
    space = Space(Envelope(areas))
    frame = space.frame(HOME)
    inclusion, exclusion = ([frame.metres(corner(*c)) for c in ring] for ring in (inclusion, exclusion))
    way = [frame.spot(corner(*spot[:2]), spot[2]) for spot in (a, b)]
    rules = space.rules(None)
    deepest = 0.0
    for number in range(SAMPLES + 1):
        share = number / SAMPLES
        spot = Spot(*(p + share * (q - p) for p, q in zip(*way, strict=True)))
        beside = 0.0 if naively_inside(spot, inclusion) else naively_to_border(spot, inclusion)
        naive = math.hypot(beside, max(spot.up - 80.0, 0.0))
        if naively_inside(spot, exclusion):
            inner = min(naively_to_border(spot, exclusion), spot.up - floor, floor + thick - spot.up)
            naive = max(naive, inner)
        assert outside_by(spot, rules) == pytest.approx(naive, abs=1e-6)
        deepest = max(deepest, naive)
    violation = space.breach(way, rules, may_return=False)
    assert violation is not None or deepest <= TOUCH + 1e-6
    if violation is not None:
        assert violation.by > TOUCH and outside_by(violation.at, rules) == pytest.approx(violation.by)
        assert to_leg(violation.at, *way) < 1e-6


def test_of_many_masts_only_those_that_a_way_comes_near_to_are_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each position of each vehicle is held against the envelope: 200 areas took 7 ms."""
    masts = [square(2, north=10.0 * n, east=50, name=f"mast {n}", inclusion=False) for n in range(-90, 90)]
    space, asked = Space(Envelope((square(1000), *masts))), list[str]()
    broken = Rule.broken
    monkeypatch.setattr(Rule, "broken", lambda rule, a, b: asked.append(rule.what) or broken(rule, a, b))
    assert breach(space, (0, 0, 10), (100, 0, 10)) is None
    assert asked == ["field"]
    assert breach(space, (31, 60, 10), (31, 0, 10)).what == "mast 3"
    assert asked == ["field", "field", "mast 3"]


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(POINT, POINT), min_size=1, max_size=8), st.floats(0, 30))
def test_many_legs_at_once_break_what_one_after_the_other_does(legs: list[tuple[Spot, Spot]], inset: float) -> None:
    masts = (square(15, name="low", inclusion=False, ceiling=20), square(9, north=40, name="high", inclusion=False))
    space = Space(Envelope((square(60), *masts)))
    rules = space.rules(None, inset)
    found = space.first_breach(rows([a for a, _ in legs]), rows([b for _, b in legs]), rules)
    alone = (space.breach(leg, rules, may_return=number == 0) for number, leg in enumerate(legs))
    expected = next(((number, one) for number, one in enumerate(alone) if one is not None), None)
    assert found == expected
