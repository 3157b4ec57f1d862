"""Networks as C headers and as ONNX: their outputs are those of the policy, and their words fit."""

import re
import shutil
import subprocess

import numpy as np
import pytest

from swarm_forage_env import ConfigError, export_policy, scenario
from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.policies.interface import InterfaceConfig, LearnerInterface
from swarm_forage_env.policies.kernels.frames import take_frames
from swarm_forage_env.policies.kernels.network import pick
from swarm_forage_env.policies.network import Network, NetworkAbout
from swarm_forage_env.policies.pretrained import network_file
from swarm_forage_env.training.manual import manual_of
from tests.support.networks import network_of

PROGRAM = """\
#include <stdio.h>
#include "NAME.h"

int main(void)
{
    float inputs[UPPER_INPUTS], outputs[UPPER_OUTPUTS];
    while (fread(inputs, sizeof inputs, 1, stdin) == 1) {
        NAME_forward(inputs, outputs);
        fwrite(outputs, sizeof outputs, 1, stdout);
    }
    return 0;
}
"""
CHOOSING = """\
#include <stdio.h>
#include "NAME.h"

int main(void)
{
    float outputs[UPPER_OUTPUTS];
    double chance;
    int chosen[2];
    while (fread(outputs, sizeof outputs, 1, stdin) == 1 && fread(&chance, sizeof chance, 1, stdin) == 1) {
        chosen[0] = NAME_likeliest(outputs);
        chosen[1] = NAME_draw(outputs, chance);
        fwrite(chosen, sizeof chosen, 1, stdout);
    }
    return 0;
}
"""
FRAMES = """\
#include <stdint.h>
#include <stdio.h>

int main(void)
{
    float s[SIZE], inputs[SIZE];
    uint64_t i, n, m, f;
    int c;
    while (fread(&i, sizeof i, 1, stdin) && fread(&n, sizeof n, 1, stdin) && fread(s, sizeof s, 1, stdin)) {
        for (c = 0; c < SIZE; c++)
            inputs[c] = s[c];
        FORMULAS
        fwrite(inputs, sizeof inputs, 1, stdout);
    }
    return 0;
}
"""
LARGE = 40
"""Rows of observations."""


NETWORKS = {
    "generalist": Network.load(network_file("generalist")),
    "relu and gripper": network_of(InterfaceConfig(observation="compact", actions="discrete"), 20, activation="relu"),
    "commands": network_of(InterfaceConfig(), 16, 8),
    "drives only": network_of(InterfaceConfig(observation="compact", automatic_gripper=True)),
}


def rows(network):
    return np.random.default_rng(1).uniform(-1.0, 1.0, (LARGE, len(network.weights[0]))).astype(np.float32)


def expected(network, seen):
    outputs = network.outputs(seen)
    return outputs if network.about.interface.actions == "discrete" else outputs.clip(-1.0, 1.0)


def answer(folder, name, program, content):
    """What a C program answers that includes the header of that name in the folder."""
    compiler = shutil.which("gcc")
    if compiler is None:
        pytest.skip("needs a C compiler: gcc is not installed")
    (folder / "main.c").write_text(program.replace("NAME", name).replace("UPPER", name.upper()))
    strict = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O2"]
    subprocess.run([compiler, *strict, "main.c", "-o", "main"], cwd=folder, check=True)
    return subprocess.run([folder / "main"], input=content, capture_output=True, check=True).stdout


@pytest.mark.parametrize("which", NETWORKS)
def test_the_header_computes_what_the_policy_does(which, tmp_path):
    network = NETWORKS[which]
    network.save(tmp_path / "my net.npz")
    export_policy(tmp_path / "my net.npz", tmp_path / "my_net.h")
    seen = rows(network)
    found = np.frombuffer(answer(tmp_path, "my_net", PROGRAM, seen.tobytes()), np.float32)
    np.testing.assert_allclose(found.reshape(LARGE, -1), expected(network, seen), rtol=1e-6, atol=1e-6)


def test_the_header_chooses_as_the_policy_does(tmp_path):
    export_policy("generalist", tmp_path / "generalist.h")
    rng = np.random.default_rng(2)
    logits, chances = rng.normal(0.0, 2.0, (LARGE, 6)).astype(np.float32), rng.random(LARGE)
    content = b"".join(row.tobytes() + chance.tobytes() for row, chance in zip(logits, chances, strict=True))
    found = np.frombuffer(answer(tmp_path, "generalist", CHOOSING, content), np.int32).reshape(LARGE, 2)
    room = np.zeros(6)
    both = [[pick(row, s, chance, room) for s in (False, True)] for row, chance in zip(logits, chances, strict=True)]
    np.testing.assert_array_equal(found, both)
    assert (found[:, 0] != found[:, 1]).any()


@pytest.mark.parametrize("which", NETWORKS)
def test_onnx_computes_what_the_policy_does(which, tmp_path):
    pytest.importorskip("onnx")
    runtime = pytest.importorskip("onnxruntime")
    network = NETWORKS[which]
    network.save(tmp_path / "net.npz")
    file = export_policy(tmp_path / "net.npz", tmp_path / "net.onnx")
    session = runtime.InferenceSession(file, providers=["CPUExecutionProvider"])
    seen = rows(network)
    (found,) = session.run(None, {"inputs": seen})
    largest = max(1.0, float(np.abs(network.outputs(seen)).max()))  # libraries add up in orders of their own
    np.testing.assert_allclose(found, expected(network, seen), rtol=1e-6, atol=1e-6 * largest)
    about = session.get_modelmeta().custom_metadata_map["about"]
    assert NetworkAbout.from_json(about) == network.about


def test_the_formulas_of_frames_do_what_runs_do(tmp_path):
    which = "generalist"
    seen, swarm = rows(NETWORKS[which]), SwarmSpec.of(scenario("warehouse_small", n_robots=LARGE))
    frames = LearnerInterface(NETWORKS[which].about.interface, swarm).translation.frames
    words = manual_of(NETWORKS[which], scenario("warehouse_small"))
    begins = "    m =", "    f =", 12 * " "
    formulas = " ".join(line.strip() for line in words if line.startswith(begins)).replace("nothing more", "")
    formulas = re.sub(r"f == (\d):(.*?)(?=f ==|$)", r"if (f == \1) {\2}", formulas)
    program = FRAMES.replace("SIZE", str(seen.shape[1])).replace("FORMULAS", formulas)
    taken = set()
    for decision in (0, 49, 5000):
        told = [np.array([i, decision], np.uint64).tobytes() + row.tobytes() for i, row in enumerate(seen)]
        found = np.frombuffer(answer(tmp_path, "", program, b"".join(told)), np.float32).reshape(seen.shape)
        view = seen.copy()
        take_frames(view, decision, frames)
        np.testing.assert_array_equal(found, view)
        taken |= {*frames.taken}
    assert taken == {*range(8)}


def test_what_is_no_network_or_no_known_file_is_refused(tmp_path):
    with pytest.raises(ConfigError, match=r"ends in \.h \(a C header\) or \.onnx \(ONNX\), got .*net\.txt"):
        export_policy("generalist", tmp_path / "net.txt")
    with pytest.raises(ConfigError, match="Expected a network"):
        export_policy("crw", tmp_path / "net.h")
