"""Power-law clusters: how many, how large, where."""

import itertools

import numpy as np
import pytest
from scipy.stats import chisquare

from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env.contract.codes import CELL_CACHE, CELL_EMPTY
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.presets import SEARCH_AND_RESCUE_OBJECTS, scenario
from swarm_forage_env.scenarios.quirks import Quirks
from swarm_forage_env.world.allocation import new_objects
from swarm_forage_env.world.clusters import (
    ClusterLaw,
    cluster_law,
    draw_clusters,
    draw_program_sizes,
    draw_sizes,
    footprint,
)
from swarm_forage_env.world.kernels.placement import count_objects
from swarm_forage_env.world.placement import draw_source, place_all, static_cache_centres
from swarm_forage_env.world.state import ObjectState

LAW_TABLE = {
    16: (3, 4, {8}, 10),
    32: (4, 5, {16}, 17),
    48: (4, 5, {16}, 23),
    64: (4, 5, {16}, 28),
    80: (4, 6, {16, 32}, 34),
    96: (5, 6, {32}, 39),
    112: (5, 6, {32}, 44),
    128: (5, 7, {32, 64}, 49),
}
"""Side in metres: k_min, k_max, sizes and number of clusters in the authors' program."""
PROGRAM = Quirks(large_clusters_likelier=True)


def painted(config: ScenarioConfig) -> ObjectState:
    """Return the objects of a world whose static caches stand already."""
    objects = new_objects(config)
    half = config.cache_side_cells // 2
    for slot, (x, y) in enumerate(static_cache_centres(config)):
        objects.floor[y - half : y + half + 1, x - half : x + half + 1] = CELL_CACHE - slot
    return objects


@pytest.mark.parametrize("side", LAW_TABLE)
def test_cluster_law_table(side):
    k_min, k_max, sizes, n_clusters = LAW_TABLE[side]
    law = cluster_law(side)
    assert law == ClusterLaw(k_min, k_max, n_clusters)
    drawn = np.concatenate([draw_program_sizes(law, np.random.default_rng(seed)) for seed in range(20)])
    assert set(drawn.tolist()) == sizes


@pytest.mark.parametrize(("k_min", "k_max"), [(4, 6), (3, 8)])
def test_larger_sizes_are_more_likely_in_the_program(k_min, k_max):
    n_clusters = 20_000
    sizes = draw_program_sizes(ClusterLaw(k_min, k_max, n_clusters), np.random.default_rng(1))
    exponents = np.arange(k_min, k_max)
    observed = [np.count_nonzero(sizes == 2**k) for k in exponents]
    expected = n_clusters * ((exponents + 1) ** 3 - exponents**3) / (k_max**3 - k_min**3)
    assert np.all(np.diff(expected) > 0)
    assert sum(observed) == n_clusters
    assert chisquare(observed, expected).pvalue > 0.001


def test_twice_as_large_is_half_as_likely():
    law = ClusterLaw(4, 6, 34)
    sizes = draw_sizes(law, 400_000, np.random.default_rng(1))
    observed = [np.count_nonzero(sizes == size) for size in (8, 16, 32, 64)]
    assert len(sizes) - sum(observed) <= 1  # the last one is cut
    expected = np.array([8, 4, 2, 1]) / 15 * sum(observed)
    assert chisquare(observed, expected).pvalue > 0.001


@pytest.mark.parametrize("side", [16, 48, 128])
@pytest.mark.parametrize(("quirks", "caches"), [(Quirks(), "static"), (PROGRAM, "none")], ids=["described", "program"])
def test_clusters_keep_off_nest_caches_and_each_other(side, quirks, caches):
    config = scenario("search_and_rescue", side_m=side, caches=caches, quirks=quirks)
    floor = (painted(config) if caches == "static" else new_objects(config)).floor
    x_low, y_low, x_high, y_high = config.arena.distributable_cells
    for seed in range(5):
        boxes, sizes = draw_clusters(config, floor, np.random.default_rng(seed))
        assert len(boxes) == len(sizes)
        if quirks == PROGRAM:
            assert len(boxes) == LAW_TABLE[side][3]
        for box, size in zip(boxes.tolist(), sizes.tolist(), strict=True):
            assert (box[2] - box[0], box[3] - box[1]) == footprint(size)
            assert x_low <= box[0] < box[2] <= x_high
            assert y_low <= box[1] < box[3] <= y_high
            assert np.all(floor[box[1] : box[3], box[0] : box[2]] == CELL_EMPTY)
        for a, b in itertools.combinations(boxes.tolist(), 2):
            assert a[2] < b[0] or b[2] < a[0] or a[3] < b[1] or b[3] < a[1]  # at least one cell between them


@pytest.mark.parametrize("side", LAW_TABLE)
def test_preset_counts_always_fit(side):
    quirks = PROGRAM if side in (16, 48, 80) else Quirks()
    config = scenario("search_and_rescue", side_m=side, quirks=quirks)
    floor = new_objects(config).floor
    for seed in range(10):
        source = draw_source(config, floor, stream_rng(seed, Stream.PLACEMENT))
        assert source.capacity.sum() >= SEARCH_AND_RESCUE_OBJECTS[side]


@pytest.mark.parametrize(("side", "seed"), [(16, 0), (48, 1), (128, 2)])
def test_every_object_lies_in_a_cluster_within_its_capacity(side, seed):
    config = scenario("search_and_rescue", side_m=side, caches="static")
    objects = painted(config)
    rng = stream_rng(seed, Stream.PLACEMENT)
    source = draw_source(config, objects.floor, rng)
    place_all(objects, source, config.arena.distributable_cells, rng)
    occupancy = np.array([count_objects(objects.floor, *box) for box in source.regions.tolist()])
    assert occupancy.sum() == config.objects.n_objects
    assert np.all(occupancy <= source.capacity)
