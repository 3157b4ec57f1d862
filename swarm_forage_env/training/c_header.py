"""A network as a C header: C99 without any library, with the words of its manual as comments.

The functions do what `policies.kernels.network` does, in the same order, so that outputs agree to the last bits. They
are `inline`, because compilers then accept that a program does not call each of them.
"""

import re
from collections.abc import Iterable, Iterator
from textwrap import wrap

import numpy as np

from swarm_forage_env.policies.network import Network
from swarm_forage_env.training.manual import WIDTH

_TANH = """\
/* tanh, at most 4e-7 of its value from the true one: Lambert's fraction at a quarter of x, then tanh 2y twice. */
static inline float {name}_tanh(float x)
{{
    float s, above, below, twice;
    int k;
    x = x < 9.0f ? x : 9.0f;
    x = 0.25f * (x > -9.0f ? x : -9.0f);
    s = x * x;
    above = x * (((s + 378.0f) * s + 17325.0f) * s + 135135.0f);
    below = ((28.0f * s + 3150.0f) * s + 62370.0f) * s + 135135.0f;
    for (k = 0; k < 2; k++) {{
        twice = 2.0f * above * below;
        below = below * below + above * above;
        above = twice;
    }}
    return above / below;
}}
"""
_LAYER = """\
static inline void {name}_layer(
    const float *x, int n_in, const float *weights, const float *biases, int n_out, float *y)
{{
    int i, j;
    for (j = 0; j < n_out; j++) {{
        float sum = biases[j];
        for (i = 0; i < n_in; i++)
            sum += x[i] * weights[i * n_out + j];
        y[j] = sum;
    }}
}}
"""
_LIKELIEST = """\
/* The action with the largest output, the first of several. */
static inline int {name}_likeliest(const float outputs[{upper}_OUTPUTS])
{{
    int k, best = 0;
    for (k = 1; k < {upper}_OUTPUTS; k++)
        if (outputs[k] > outputs[best])
            best = k;
    return best;
}}
"""
_DRAW = """\
/* e to the power of x <= 0, at most 1e-5 of its value from the true one down to x = -10. */
static inline double {name}_power(double x)
{{
    double s, even, odd, share;
    x = (x > -64.0 ? x : -64.0) / 16.0;
    s = x * x;
    even = 120.0 + 12.0 * s;
    odd = x * (60.0 + s);
    share = (even + odd) / (even - odd);
    share *= share;
    share *= share;
    share *= share;
    return share * share;
}}

/* An action drawn by the probabilities of all; chance is uniform in [0, 1). */
static inline int {name}_draw(const float outputs[{upper}_OUTPUTS], double chance)
{{
    double powers[{upper}_OUTPUTS], total = 0.0;
    const double most = outputs[{name}_likeliest(outputs)];
    int k;
    for (k = 0; k < {upper}_OUTPUTS; k++)
        total += powers[k] = {name}_power(outputs[k] - most);
    chance *= total;
    for (k = 0; k < {upper}_OUTPUTS - 1; k++) {{
        chance -= powers[k];
        if (chance < 0.0)
            return k;
    }}
    return {upper}_OUTPUTS - 1;
}}
"""


def c_header(network: Network, name: str, manual: Iterable[str]) -> str:
    """Return the text of the header: comments, weights, `NAME_forward`, and for numbered actions how one is chosen.

    Args:
        network: What it computes.
        name: Of the policy; what C allows of it begins all names.
        manual: Lines for the comment.
    """
    prefix, is_discrete = identifier_of(name), network.about.interface.actions == "discrete"
    upper = prefix.upper()
    names = {"name": prefix, "upper": upper}
    parts = [
        _comment((f"The policy {name} as a network in C, exported by swarm_forage_env.", "", *manual)),
        f"#ifndef {upper}_H\n#define {upper}_H\n",
        f"#define {upper}_INPUTS {network.n_columns}\n#define {upper}_OUTPUTS {len(network.biases[-1])}\n",
        *_arrays(network, prefix),
        *([_TANH.format(**names)] if _is_tanh(network) else []),
        _LAYER.format(**names),
        _forward(network, is_discrete, **names),
    ]
    if is_discrete:
        parts += [_LIKELIEST.format(**names), *([_DRAW.format(**names)] if network.about.samples else [])]
    return "\n".join([*parts, "#endif\n"])


def identifier_of(name: str) -> str:
    """Return a name with letters, digits and _ only, as C wants it."""
    found = re.sub(r"\W", "_", name, flags=re.ASCII)
    return found if found[:1].isalpha() else f"policy_{found}"


def _is_tanh(network: Network) -> bool:
    return network.about.activation == "tanh" and len(network.weights) > 1


def _comment(lines: tuple[str, ...]) -> str:
    """Return lines as one comment; `*/` within them, which would end it, is taken apart."""
    body = [f" * {line}".rstrip().replace("*/", "* /") for line in lines]
    return "\n".join(["/*", *body, " */\n"])


def _arrays(network: Network, name: str) -> Iterator[str]:
    for k, (weight, bias) in enumerate(zip(network.weights, network.biases, strict=True)):
        yield _array(f"{name}_weights_{k}", weight, f"({weight.shape[0]}, {weight.shape[1]}), a row per input")
        yield _array(f"{name}_biases_{k}", bias, f"({len(bias)},)")


def _array(name: str, values: np.ndarray, shape: str) -> str:
    numbers = ", ".join(f"{np.format_float_scientific(value)}f" for value in values.astype(np.float32).ravel())
    rows = "\n".join(f"    {line}" for line in wrap(numbers, WIDTH, break_on_hyphens=False))
    return f"/* {shape} */\nstatic const float {name}[{values.size}] = {{\n{rows}\n}};\n"


def _forward(network: Network, is_discrete: bool, name: str, upper: str) -> str:
    widths = [len(bias) for bias in network.biases]
    last = len(widths) - 1
    lines = [
        "/* Outputs of one robot for its inputs. */",
        f"static inline void {name}_forward(const float inputs[{upper}_INPUTS], float outputs[{upper}_OUTPUTS])",
        "{",
        *([f"    float values[2][{max(widths[:-1])}];"] if last else []),
        *(["    int k;"] if last or not is_discrete else []),
    ]
    for k, width in enumerate(widths):
        source = "inputs" if k == 0 else f"values[{(k - 1) % 2}]"
        target = "outputs" if k == last else f"values[{k % 2}]"
        given = f"{source}, {len(network.weights[k])}, {name}_weights_{k}, {name}_biases_{k}, {width}, {target}"
        lines.append(f"    {name}_layer({given});")
        if k < last:
            at = f"{target}[k]"
            active = f"{name}_tanh({at})" if _is_tanh(network) else f"{at} > 0.0f ? {at} : 0.0f"
            lines += [f"    for (k = 0; k < {width}; k++)", f"        {at} = {active};"]
    if not is_discrete:
        cut = "outputs[k] < -1.0f ? -1.0f : outputs[k] > 1.0f ? 1.0f : outputs[k]"
        lines += [f"    for (k = 0; k < {upper}_OUTPUTS; k++)", f"        outputs[k] = {cut};"]
    return "\n".join([*lines, "}\n"])
