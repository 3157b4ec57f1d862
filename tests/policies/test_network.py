"""Network files and the policy that runs them: exact outputs, draws by probability, files that are whole."""

import dataclasses
import itertools
import json

import numpy as np
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.policies.kernels.network import pick, power
from swarm_forage_env.policies.learned import LearnedPolicy
from swarm_forage_env.policies.network import Network, NetworkAbout, NetworkError, NetworkPolicy
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.views.pettingzoo import parallel_env
from tests.reference import perceptron
from tests.support.crowded_runs import change_population
from tests.support.networks import network_of

DRIVEN = InterfaceConfig(observation="compact", automatic_gripper=True)
NUMBERED = dataclasses.replace(DRIVEN, actions="discrete")


def about(interface=DRIVEN, **changes) -> NetworkAbout:
    return NetworkAbout(**{"interface": interface, "activation": "tanh", "samples": False} | changes)


def small_network(**changes) -> Network:
    """Two columns, two hidden units, two outputs; no interface has so few columns."""
    weights = (np.array([[1.0, -1.0], [0.0, 2.0]], np.float32), np.array([[1.0, 0.0], [0.0, 3.0]], np.float32))
    biases = (np.array([0.0, 0.5], np.float32), np.array([0.25, 0.0], np.float32))
    return Network(weights, biases, about(**changes))


def layers_of(network: Network) -> tuple[np.ndarray, ...]:
    return network.weights + network.biases


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
    for shape in ((3, 1), (3, 40), (2,)):
        with pytest.raises(NetworkError, match=r"observations \(N, 2\), as the network takes, got \("):
            small_network().outputs(np.zeros(shape, np.float32))


@pytest.mark.parametrize(("activation", "sizes"), [("tanh", (31, 64, 64, 6)), ("relu", (5, 2, 7)), ("tanh", (1, 3))])
def test_outputs_are_those_of_the_slow_twin_bit_for_bit(activation, sizes):
    chance = np.random.default_rng(len(sizes))
    weights = [chance.normal(size=size).astype(np.float32) for size in itertools.pairwise(sizes)]
    biases = [chance.normal(size=size).astype(np.float32) for size in sizes[1:]]
    network = Network(tuple(weights), tuple(biases), about(activation=activation))
    rows = chance.normal(size=(9, sizes[0])).astype(np.float32)
    ours = network.outputs(rows)
    assert ours.tobytes() == perceptron.outputs(weights, biases, rows, activation).tobytes()
    for row in range(9):
        assert network.outputs(rows[row : row + 1]).tobytes() == ours[row].tobytes(), "whatever rows are beside it"


def test_powers_are_good_enough_to_draw_by():
    x = np.linspace(-10.0, 0.0, 1001)
    np.testing.assert_allclose([power(one) for one in x], np.exp(x), rtol=1e-5)
    assert power(0.0) == 1.0
    assert 0.0 < power(-1e30) == power(-64.0) < 1e-20


def test_discrete_choices_are_the_likeliest_or_drawn_by_their_probabilities():
    logits, room = np.array([0.25, 1.5, -2.0], np.float32), np.zeros(4)
    chances = (np.arange(2000) + 0.5) / 2000
    assert {pick(logits, False, chance, room) for chance in chances} == {1}
    shares = np.bincount([pick(logits, True, chance, room) for chance in chances]) / len(chances)
    assert shares == pytest.approx(perceptron.probabilities(logits), abs=1e-3)
    assert pick(np.array([2.0, 2.0], np.float32), False, 0.0, room) == 0, "the first of several"
    unlikely = np.array([-1e9, 0.0, -200.0, -np.inf], np.float32)
    assert [pick(unlikely, True, chance, room) for chance in (0.0, 0.5, np.nextafter(1.0, 0.0))] == [0, 1, 1]


def test_a_temperature_makes_likely_actions_likelier():
    network = Network(
        (np.array([[0.5, -1.0, 2.0]], np.float32),),
        (np.array([0.25, 1.5, -2.0], np.float32),),
        about(NUMBERED, samples=True),
    )
    row = np.array([[1.5]], np.float32)
    learnt, sharp = (
        np.array(perceptron.probabilities(one.outputs(row)[0])) for one in (network, network.at_temperature(0.5))
    )
    assert sharp == pytest.approx(learnt**2 / np.sum(learnt**2), rel=1e-5), "to the power of 1 / 0.5"
    assert network.at_temperature(1.0) is network
    with pytest.raises(ConfigError, match=r"temperature to be a number from 0\.0001 to 100, got 0"):
        network.at_temperature(0.0)
    for wrong in (about(NUMBERED), about(samples=True)):
        with pytest.raises(NetworkError, match="draws discrete actions, got one that takes the likeliest"):
            dataclasses.replace(network, about=wrong).at_temperature(0.5)


def test_files_give_back_what_was_written_and_are_replaced_whole_or_not_at_all(tmp_path):
    path = tmp_path / "network.npz"
    network = network_of(NUMBERED, 8, samples=True, caches="static", card={"by": ["hand", 1]})
    network.save(path)
    again, before = Network.load(path), path.read_bytes()
    assert again.about == network.about
    for one, other in zip(layers_of(network), layers_of(again), strict=True):
        np.testing.assert_array_equal(one, other, strict=True)
    assert all(isinstance(load_policy(one), NetworkPolicy) for one in (path, str(path)))
    with pytest.raises(ValueError, match="plain JSON values"):
        network_of(DRIVEN, 8, card={"not": {"plain"}}).save(path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


ABOUT = json.loads(small_network().about.to_json())


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "no .npz archive of plain arrays, or a damaged one"),
        ({"numbers": np.zeros(3)}, "Expected the arrays about, got numbers"),
        ({"weight_0": np.zeros((2, 2)), "about": np.array("{}")}, "about, weight_0, bias_0, got weight_0, about"),
        ({"about": np.array("{")}, "description of a network, got '{'"),
        ({"about": np.array(json.dumps(ABOUT | {"activaton": "red"}))}, "Did you mean 'activation'"),
        ({"about": np.array(json.dumps(ABOUT | {"interface": {"actions": "diskrete"}}))}, "Did you mean 'discrete'"),
        ({"about": np.array(json.dumps(ABOUT | {"interface": {"action": "discrete"}}))}, "mean .interface.actions"),
        ({"about": np.array(json.dumps(ABOUT))}, r"layers that follow on each other, got weights \[\]"),
    ],
)
def test_other_files_are_refused_by_their_name(tmp_path, content, reason):
    path = tmp_path / "network.npz"
    if isinstance(content, bytes):
        path.write_bytes(content)
    else:
        np.savez(path, **content)
    with pytest.raises(NetworkError, match=reason) as refusal:
        Network.load(path)
    assert str(path) in str(refusal.value)


def test_layers_that_are_no_network_are_refused():
    network = small_network()
    first, second = network.weights
    for weights, biases, reason in (
        ((first, np.zeros((3, 2), np.float32)), network.biases, "follow on each other"),
        ((), (), "follow on each other"),
        ((first, np.full((2, 2), np.nan, np.float32)), network.biases, "finite numbers"),
        ((first.astype(np.float64) * 1e300, second), network.biases, "finite numbers"),
    ):
        with pytest.raises(NetworkError, match=reason):
            Network(weights, biases, network.about)


def test_a_network_that_does_not_fit_its_interface_is_refused_before_it_is_kept_or_run(tmp_path):
    env = parallel_env("warehouse_small", n_robots=2, n_objects=20)
    narrow, reason = small_network(), "from 23 columns to 2 actions, as its interface says, got one from 2 to 2"
    with pytest.raises(NetworkError, match=reason):
        NetworkPolicy(narrow).reset(env.swarm_spec, np.random.default_rng(0))
    with pytest.raises(NetworkError, match=reason):
        narrow.save(tmp_path / "narrow.npz")
    with pytest.raises(NetworkError, match=reason):
        Network.from_state_dict(state_dict(narrow), narrow.about)
    with pytest.raises(NetworkError, match=r"to 6 actions, .* got one from 23 to 2"):
        dataclasses.replace(network_of(DRIVEN, 8), about=about(NUMBERED)).save(tmp_path / "few.npz")
    assert list(tmp_path.iterdir()) == []


def state_dict(network: Network) -> dict[str, np.ndarray]:
    """As torch names and lays out linear layers, with something beside them."""
    layers = {
        f"mlp.{2 * k}.{name}": array
        for k, (weight, bias) in enumerate(zip(network.weights, network.biases, strict=True))
        for name, array in (("weight", weight.T), ("bias", bias))
    }
    return {**layers, "steps": np.array(3.0)}


@pytest.mark.parametrize("kind", ["arrays", "tensors"])
def test_layers_of_a_state_dict_make_the_same_network(kind):
    network = network_of(DRIVEN, 8)
    state = state_dict(network)
    if kind == "tensors":
        torch = pytest.importorskip("torch")
        state = {name: torch.nn.Parameter(torch.tensor(array)) for name, array in state.items()}
    taken = Network.from_state_dict(state, network.about)
    for layer, expected in zip(layers_of(taken), layers_of(network), strict=True):
        np.testing.assert_array_equal(layer, expected)
    del state["mlp.2.bias"]
    with pytest.raises(NetworkError, match="layers that follow on each other"):
        Network.from_state_dict(state, network.about)


# In runs

N_ROBOTS = 9  # no multiple of the rows that go through the layers together
DISCRETE = {"actions": "discrete", "automatic_gripper": True}
COMPACT = {"observation": "compact", "decision_ticks": 3, "site_memory": True}


@pytest.mark.parametrize(
    ("choices", "about", "fields"),
    [
        (DISCRETE | COMPACT, {"samples": True}, {}),
        (DISCRETE | COMPACT | {"frame_decisions": 4}, {"samples": True}, {}),
        ({"frame_decisions": 5}, {}, {}),
        ({"actions": "discrete", "decision_ticks": 2}, {"samples": True}, {"caches": "dynamic"}),
        ({"automatic_gripper": True, "neighbours_seen": 2}, {"activation": "relu"}, {"neighbours_seen": 2}),
        ({"observation": "compact", "message_size": 2}, {}, {"message_size": 2}),
        ({"automatic_gripper": True}, {}, {"message_size": 2}),
    ],
)
def test_a_network_acts_as_its_slow_twin(choices, about, fields):
    env = ForageEnv(scenario("warehouse_small", n_robots=N_ROBOTS, n_objects=200, **fields))
    interface = InterfaceConfig(**choices)
    network = network_of(interface, 5, 13, seed=3, swarm=env.swarm_spec, **about)
    policy, spec, crowd = NetworkPolicy(network), env.swarm_spec, np.random.default_rng(5)
    twin = LearnedPolicy(interface, choose=perceptron.SlowNetwork(network, N_ROBOTS, stream_rng(2, Stream.POLICY)))
    for one in (policy, twin):
        one.reset(spec, stream_rng(2, Stream.POLICY))
    obs = env.reset_batch(2)
    for tick in range(60):
        actions = policy.act(obs, env.active)
        expected = twin.act(obs, env.active)
        assert actions.tobytes() == expected.tobytes(), f"tick {tick}"
        assert policy.chosen.tolist() == twin.chosen.tolist()
        obs, *_ = env.step_batch(actions)
        if tick % 7 == 0:
            change_population(env, crowd)
