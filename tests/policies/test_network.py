"""Networks in files: evaluated as by hand, read back as written, refused when broken."""

import copy
import itertools
import json

import numpy as np
import pytest

from swarm_forage_env._internal.files import replacing
from swarm_forage_env.contract.policy import Policy
from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.policies.kernels.network import pick, power
from swarm_forage_env.policies.learned import LearnedPolicy
from swarm_forage_env.policies.network import Network, NetworkAbout, NetworkError, NetworkPolicy
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.views.pettingzoo import parallel_env
from tests.reference import perceptron
from tests.support.branches import pickled


def small_network(**about) -> Network:
    """Two columns, two hidden units, two outputs."""
    weights = (np.array([[1.0, -1.0], [0.0, 2.0]], np.float32), np.array([[1.0, 0.0], [0.0, 3.0]], np.float32))
    biases = (np.array([0.0, 0.5], np.float32), np.array([0.25, 0.0], np.float32))
    about = {"interface": InterfaceConfig(automatic_gripper=True)} | about
    return Network(weights, biases, NetworkAbout(**about))


def compact_network(n_actions: int, rng: np.random.Generator, **about) -> Network:
    weights = tuple(rng.normal(size=size).astype(np.float32) for size in ((23, 8), (8, n_actions)))
    biases = tuple(rng.normal(size=size).astype(np.float32) for size in (8, n_actions))
    return Network(weights, biases, NetworkAbout(**about))


@pytest.mark.parametrize(
    ("activation", "expected"),
    [
        ("relu", [1.0 + 0.25, 3 * 0.5]),  # hidden: relu(1), relu(-1 + 1 + 0.5)
        ("tanh", [np.tanh(1.0) + 0.25, 3 * np.tanh(0.5)]),
    ],
)
def test_outputs_by_hand(activation, expected):
    rows = np.array([[1.0, 0.5]], np.float32)
    np.testing.assert_allclose(small_network(activation=activation).outputs(rows), [expected], rtol=1e-6)


@pytest.mark.parametrize("activation", ["tanh", "relu"])
@pytest.mark.parametrize("sizes", [(31, 64, 64, 6), (1, 3), (5, 2, 7), (4, 4, 1)])
def test_outputs_are_those_of_the_slow_twin_bit_for_bit(activation, sizes):
    chance = np.random.default_rng(len(sizes))
    weights = [chance.normal(size=size).astype(np.float32) for size in itertools.pairwise(sizes)]
    biases = [chance.normal(size=size).astype(np.float32) for size in sizes[1:]]
    network = Network(tuple(weights), tuple(biases), NetworkAbout(interface=InterfaceConfig(), activation=activation))
    rows = chance.normal(size=(9, sizes[0])).astype(np.float32)
    ours = network.outputs(rows)
    assert ours.tobytes() == perceptron.outputs(weights, biases, rows, activation).tobytes()
    for row in range(9):
        assert network.outputs(rows[row : row + 1]).tobytes() == ours[row].tobytes(), "whatever rows are beside it"


def test_rows_of_another_number_of_columns_are_refused():
    for shape in ((3, 1), (3, 40), (2,)):
        with pytest.raises(NetworkError, match=r"observations \(N, 2\), as the network takes, got \("):
            small_network().outputs(np.zeros(shape, np.float32))


def test_tanh_is_good_to_float32():
    identity = np.eye(1, dtype=np.float32), np.zeros(1, np.float32)
    about = NetworkAbout(interface=InterfaceConfig(), activation="tanh")
    network = Network((identity[0],) * 2, (identity[1],) * 2, about)
    x = np.concatenate([np.linspace(-12, 12, 4001), [1e-30, -1e-8, 1e4, -1e30]]).astype(np.float32)
    np.testing.assert_allclose(network.outputs(x[:, None])[:, 0], np.tanh(x.astype(float)), rtol=4e-7, atol=1e-38)


def test_discrete_choices_are_the_likeliest_or_drawn_by_their_probabilities():
    logits, room = np.array([0.25, 1.5, -2.0], np.float32), np.zeros(3)
    chances = (np.arange(2000) + 0.5) / 2000
    assert {pick(logits, False, chance, room) for chance in chances} == {1}
    shares = np.bincount([pick(logits, True, chance, room) for chance in chances]) / len(chances)
    assert shares == pytest.approx(perceptron.probabilities(logits), abs=1e-3)
    assert pick(np.array([2.0, 2.0], np.float32), False, 0.0, room) == 0, "the first of several"


def test_a_temperature_makes_likely_actions_likelier():
    about = NetworkAbout(interface=InterfaceConfig(actions="discrete"), samples=True)
    network = Network((np.array([[0.5, -1.0, 2.0]], np.float32),), (np.array([0.25, 1.5, -2.0], np.float32),), about)
    row = np.array([[1.5]], np.float32)
    learnt, sharp = (
        np.array(perceptron.probabilities(one.outputs(row)[0])) for one in (network, network.at_temperature(0.5))
    )
    assert sharp == pytest.approx(learnt**2 / np.sum(learnt**2), rel=1e-5), "to the power of 1 / 0.5"
    assert network.at_temperature(1.0) is network


@pytest.mark.parametrize(
    ("changes", "temperature", "reason"),
    [
        ({}, 0.0, r"temperature to be a number in \[0.0001, 100\], got 0"),
        ({}, np.nan, "temperature"),
        ({"samples": False}, 0.5, "draws discrete actions, got one that takes the likeliest"),
        ({"interface": InterfaceConfig(actions="continuous")}, 0.5, "draws discrete actions"),
    ],
)
def test_a_temperature_that_would_mean_nothing_is_refused(changes, temperature, reason):
    about = NetworkAbout(**{"interface": InterfaceConfig(actions="discrete"), "samples": True, **changes})
    network = Network((np.ones((1, 3), np.float32),), (np.zeros(3, np.float32),), about)
    with pytest.raises(NetworkError, match=reason):
        network.at_temperature(temperature)


def test_what_is_next_to_impossible_is_never_a_fault():
    logits, room = np.array([-1e9, 0.0, -200.0, -np.inf], np.float32), np.zeros(4)
    assert [pick(logits, True, chance, room) for chance in (0.0, 0.5, np.nextafter(1.0, 0.0))] == [0, 1, 1]


def test_powers_are_good_enough_to_draw_by():
    x = np.linspace(-10.0, 0.0, 1001)
    np.testing.assert_allclose([power(one) for one in x], np.exp(x), rtol=1e-5)
    assert power(0.0) == 1.0
    assert 0.0 < power(-1e30) == power(-64.0) < 1e-20


def test_files_give_back_what_was_written(tmp_path):
    network = small_network(samples=True, caches="static", card={"by": ["hand", 1]})
    network.save(tmp_path / "network.npz")
    again = Network.load(tmp_path / "network.npz")
    assert again.about == network.about
    for one, other in zip((*network.weights, *network.biases), (*again.weights, *again.biases), strict=True):
        np.testing.assert_array_equal(one, other, strict=True)


ABOUT = json.loads(small_network().about.to_json())


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "no .npz archive of plain arrays, or a damaged one"),
        (b"text", "no .npz archive"),
        (b"PK\x03\x04 and no more", "no .npz archive"),
        ({"numbers": np.zeros(3)}, "Expected the arrays about, got numbers"),
        ({"weight_0": np.zeros((2, 2)), "about": np.array("{}")}, "about, weight_0, bias_0, got weight_0, about"),
        ({"weight_0": np.array([{}], object), "about": np.array("{}")}, "no .npz archive of plain arrays"),
        ({"about": np.array("{")}, "description of a network as JSON, got '{'"),
        ({"about": np.array("[1]")}, r"with its interface, got '\[1\]'"),
        ({"about": np.array("{}")}, "with its interface, got '{}'"),
        ({"about": np.array(json.dumps(ABOUT | {"activaton": "red"}))}, "Did you mean 'activation'"),
        ({"about": np.array(json.dumps(ABOUT | {"interface": {"actions": "diskrete"}}))}, "Did you mean 'discrete'"),
        (
            {"about": np.array(json.dumps(ABOUT | {"caches": "statc"}))},
            "caches to be one of none, static, dynamic, got",
        ),
        ({"about": np.array(json.dumps(ABOUT | {"samples": "no"}))}, "samples to be True or False, got 'no'"),
        ({"about": np.array(json.dumps(ABOUT | {"card": [1]}))}, r"card to be a table of values by name, got \[1\]"),
        ({"about": np.array(json.dumps(ABOUT))}, r"layers that follow on each other, got weights \[\]"),
    ],
)
def test_other_files_are_refused_in_our_words(tmp_path, content, reason):
    path = tmp_path / "network.npz"
    if isinstance(content, bytes):
        path.write_bytes(content)
    else:
        np.savez(path, **content)
    with pytest.raises(NetworkError, match=reason) as refusal:
        Network.load(path)
    assert str(path) in str(refusal.value)
    with pytest.raises(FileNotFoundError):
        Network.load(tmp_path / "nothing.npz")


def test_damaged_files_are_refused_whatever_is_damaged(tmp_path):
    path = tmp_path / "network.npz"
    compact_network(6, np.random.default_rng(0), interface=InterfaceConfig(actions="discrete")).save(path)
    whole, rng = path.read_bytes(), np.random.default_rng(0)
    complaints = []
    for _ in range(200):
        damaged = bytearray(whole)
        for at in rng.integers(len(whole), size=3):
            damaged[at] = rng.integers(256)
        path.write_bytes(damaged[: rng.integers(len(whole)) if rng.random() < 0.2 else None])
        try:
            Network.load(path)  # damage to a time stamp harms nobody
        except NetworkError as error:
            complaints.append(str(error))
    assert len(complaints) > 100
    assert all(str(path) in complaint for complaint in complaints)
    foreign = ("pickle", "in the archive", "No data left", "Error", "CRC", "zip")  # how numpy and zipfile speak
    assert not [complaint for complaint in complaints if any(word in complaint for word in foreign)]


def test_weights_that_are_no_numbers_are_refused():
    network = small_network()
    for wrong in (np.full((2, 2), np.nan, np.float32), np.full((2, 2), "a")):
        with pytest.raises(NetworkError, match="finite numbers"):
            Network((network.weights[0], wrong), network.biases, network.about)


def test_a_file_is_replaced_whole_or_not_at_all(tmp_path):
    path = tmp_path / "network.npz"
    small_network().save(path)
    before = path.read_bytes()
    with pytest.raises(TypeError):
        small_network(card={"not": {"plain"}}).save(path)
    with pytest.raises(ZeroDivisionError), replacing(path) as draft:
        draft.write_text(f"half {1 / 0}")
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_layers_that_do_not_follow_on_each_other_are_refused():
    network = small_network()
    with pytest.raises(NetworkError, match="follow on each other"):
        Network((network.weights[0], np.zeros((3, 2), np.float32)), network.biases, network.about)
    with pytest.raises(NetworkError, match="follow on each other"):
        Network((), (), network.about)
    with pytest.raises(NetworkError, match="activation to be one of tanh, relu"):
        small_network(activation="elu")


@pytest.mark.parametrize("actions", ["continuous", "discrete"])
def test_a_policy_keeps_its_choice_for_the_ticks_of_a_decision(actions):
    env = parallel_env("warehouse_small", n_robots=4, n_objects=20)
    interface = InterfaceConfig(observation="compact", actions=actions, automatic_gripper=True, decision_ticks=3)
    network = compact_network(6 if actions == "discrete" else 2, np.random.default_rng(1), interface=interface)
    policy = NetworkPolicy(network)
    assert isinstance(policy, Policy)
    policy.reset(env.swarm_spec, np.random.default_rng(0))
    obs = env.reset_batch(0)
    wheels = []
    for _ in range(12):
        chosen = policy.act(obs, env.active).copy()
        obs, *_ = env.step_batch(chosen)
        wheels.append(chosen[:, :2])
    for tick, chosen in enumerate(wheels):
        np.testing.assert_array_equal(chosen, wheels[tick - tick % 3])
    assert any(not np.array_equal(wheels[0], later) for later in wheels)


def test_a_network_that_does_not_fit_its_interface_is_refused_at_the_start_of_a_run():
    env = parallel_env("warehouse_small", n_robots=2, n_objects=20)
    with pytest.raises(NetworkError, match="from 111 columns to 2 actions, as its interface says, got one from 2 to 2"):
        NetworkPolicy(small_network()).reset(env.swarm_spec, np.random.default_rng(0))


def test_any_function_becomes_a_policy_by_naming_its_interface():
    env = parallel_env("warehouse_small", n_robots=3, n_objects=20)
    interface = InterfaceConfig(observation="compact", actions="discrete", automatic_gripper=True)
    policy = LearnedPolicy(interface, lambda rows, rng: np.ones(len(rows), np.int64), caches="static")
    policy.reset(env.swarm_spec, np.random.default_rng(0))
    assert policy.act(env.reset_batch(0), env.active)[:, :2].tolist() == [[0.5, 0.5]] * 3
    assert policy.caches == "static"
    assert "los_object" in policy.reads


def test_a_path_opens_as_well_as_its_text(tmp_path):
    compact_network(6, np.random.default_rng(0), interface=InterfaceConfig(observation="compact")).save(
        tmp_path / "net.npz"
    )
    assert isinstance(load_policy(tmp_path / "net.npz"), NetworkPolicy)
    assert isinstance(load_policy(str(tmp_path / "net.npz")), NetworkPolicy)


def state_dict() -> dict[str, np.ndarray]:
    """As torch names and lays out two linear layers, with something beside them."""
    network = small_network()
    return {
        "mlp.0.weight": network.weights[0].T,
        "mlp.0.bias": network.biases[0],
        "mlp.2.weight": network.weights[1].T,
        "mlp.2.bias": network.biases[1],
        "steps": np.array(3.0),
    }


def test_layers_of_a_state_dict_make_the_same_network():
    network = small_network()
    taken = Network.from_state_dict(state_dict(), network.about)
    rows = np.random.default_rng(0).normal(size=(5, 2)).astype(np.float32)
    np.testing.assert_array_equal(taken.outputs(rows), network.outputs(rows))


def test_tensors_make_the_same_network_as_arrays():
    torch = pytest.importorskip("torch")
    tensors = {name: torch.nn.Parameter(torch.tensor(array)) for name, array in state_dict().items()}
    taken = Network.from_state_dict(tensors, small_network().about)
    for layer, expected in zip(
        taken.weights + taken.biases, small_network().weights + small_network().biases, strict=True
    ):
        np.testing.assert_array_equal(layer, expected)


@pytest.mark.parametrize("lost", ["mlp.2.bias", "mlp.0.weight"])
def test_a_state_dict_without_all_of_its_layers_is_refused(lost):
    state = {name: array for name, array in state_dict().items() if name != lost}
    with pytest.raises(NetworkError, match="layers that follow on each other"):
        Network.from_state_dict(state, small_network().about)


@pytest.mark.parametrize("copied", [copy.deepcopy, pickled])
def test_a_copy_continues_as_the_original_does(copied):
    """Between two decisions, with actions that are drawn."""
    env = parallel_env("warehouse_small", n_robots=6, n_objects=20)
    interface = InterfaceConfig(observation="compact", actions="discrete", decision_ticks=3)
    policy = NetworkPolicy(compact_network(11, np.random.default_rng(1), interface=interface, samples=True))
    policy.reset(env.swarm_spec, np.random.default_rng(2))
    obs = env.reset_batch(3)
    for _ in range(4):
        policy.act(obs, env.active)
    twin = copied(policy)
    of_twin = [twin.act(obs, env.active).copy() for _ in range(12)]
    of_policy = [policy.act(obs, env.active).copy() for _ in range(12)]
    np.testing.assert_array_equal(of_twin, of_policy)
    assert not np.array_equal(of_policy[0], of_policy[3])


def test_numbers_that_are_finite_only_as_64_bits_are_refused(tmp_path):
    network = small_network()
    wide = tuple(weight.astype(np.float64) * 1e300 for weight in network.weights)
    with pytest.raises(NetworkError, match="finite numbers"):
        Network(wide, network.biases, network.about)


def test_layers_that_would_fill_the_memory_are_refused():
    weights = (np.zeros((1, 20_000), np.float32), np.zeros((20_000, 1), np.float32))
    with pytest.raises(NetworkError, match="numbers side by side"):
        Network(weights, (np.zeros(20_000, np.float32), np.zeros(1, np.float32)), small_network().about)
