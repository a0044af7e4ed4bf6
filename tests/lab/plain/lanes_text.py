"""The plain scene by hand in C: one set after the other, and 16 sets in a processor's vectors.

Both loops are made of the same lines. In lanes every set computes both of what the slave could do
and keeps one; a set that meets the wall or leaves it in this step, about one step in 200, is put
right afterwards by `plain_scene.meet_wall`, one at a time. Operands stand in the order of
`plain_scene.plain_step`, so that all of them give the same bits. In turn, too, both are computed:
branching instead was measured and is no faster (7.1 ns a step either way).
"""

from __future__ import annotations

from tests.lab.plain.scene import DELAY, Plain

LANES = 16
STATE = ("x1", "v1", "x2", "v2", "sum", "peak")

TAKE = """
double in1 = BACK, in2 = FORTH;
double f1 = Q(impedance) * S(v1) - Q(root) * in1;
double f2 = Q(root) * in2 - Q(impedance) * S(v2);
BACK = Q(root) * S(v2) - in2;
FORTH = Q(root) * S(v1) - in1;
double hand = 500.0 * (aim - S(x1)) - 5.0 * S(v1) - f1;
S(x1) = S(x1) + (Q(period) * S(v1) + Q(give_1) * hand);
S(v1) = S(v1) + Q(gain_1) * hand;
double size = f1 < 0.0 ? -f1 : f1;
S(peak) = size > S(peak) ? size : S(peak);
double deep = S(x2) - Q(wall);
double rest = f2 / Q(stiffness), off = deep - rest;
double wall_x = S(x2) + (Q(turn) * off + Q(lever) * S(v2));
double wall_v = S(v2) + (Q(turn) * S(v2) - Q(swing) * off);
double free_x = S(x2) + (Q(period) * S(v2) + Q(give) * f2);
double free_v = S(v2) + Q(gain) * f2;
int leaves = (wall_x <= Q(wall)) | ((S(v2) < 0.0) & (wall_v > 0.0)
    & (deep * (deep - 2.0 * rest) + Q(slack) * S(v2) * S(v2) >= 0.0));
int enters = (free_x >= Q(wall)) | ((S(v2) > 0.0) & (free_v < 0.0)
    & (deep + Q(period) * S(v2) >= 0.0));
"""
KEEP = """
double far = S(x1) - S(x2);
S(sum) = S(sum) + far * far;
"""

MEET_WALL = """
static void meet_wall(const R_Plain *p, double *x, double *v, double force) {
double deep = *x - P(wall), left = P(period), speed_now = *v;
double pull = force / P(mass), rest = force / P(stiffness);
int pressing = deep > 0.0;
for (int k = 0; k < 64; k++) {
double when = -1.0;
if (pressing) {
double bend = 2.0 * rest - deep, speed = speed_now / P(rate);
double square = speed * speed - bend * deep;
if (square >= 0.0 && speed < 0.0)
when = 2.0 * atan(deep / (sqrt(square) - speed)) / P(rate);
else if (square >= 0.0 && bend < 0.0)
when = 2.0 * atan((speed + sqrt(square)) / -bend) / P(rate);
} else {
double square = speed_now * speed_now - 2.0 * pull * deep;
if (square >= 0.0 && speed_now > 0.0)
when = -2.0 * deep / (speed_now + sqrt(square));
else if (square >= 0.0 && pull > 0.0)
when = (sqrt(square) - speed_now) / pull;
}
int met = 0.0 <= when && when < left;
double span = met ? when : left;
if (pressing) {
double half = sin(0.5 * P(rate) * span), turn = -2.0 * half * half;
double whole = sin(P(rate) * span), off = deep - rest;
deep = deep + turn * off + speed_now / P(rate) * whole;
speed_now = speed_now + turn * speed_now - P(rate) * off * whole;
} else {
deep = deep + speed_now * span + 0.5 * pull * span * span;
speed_now = speed_now + pull * span;
}
if (!met) break;
left = left - span;
deep = 0.0;
pressing = !pressing;
}
*x = P(wall) + deep;
*v = speed_now;
}
"""
"""`plain_scene.meet_wall`, operand by operand."""


def scene_text() -> str:
    """Return both loops over sets in C: `in_turn` and `side_by_side`."""
    one = [f"double q_{name} = sets[i].m_{name};" for name in Plain._fields]
    one += [f"double s_{name} = 0.0;" for name in STATE]
    many = [f"double q_{name}[L];" for name in Plain._fields]
    many += [f"double s_{name}[L];" for name in STATE]
    load = [f"q_{name}[l] = sets[i + l].m_{name};" for name in Plain._fields]
    load += [f"s_{name}[l] = 0.0;" for name in STATE]
    turn = "at = at + 1 == D ? 0 : at + 1;"
    takes = "(int64_t n, int64_t steps, R_Plain *sets, const double *aims, double *out)"
    return f"""
#include <math.h>
#include <stdint.h>
typedef struct {{ {" ".join(f"double m_{name};" for name in Plain._fields)} }} R_Plain;
#define P(name) p->m_##name
{MEET_WALL}
#define D {DELAY}
#define L {LANES}
#define Q(name) q_##name
#define S(name) s_##name
#define BACK back[at]
#define FORTH forth[at]
void in_turn{takes} {{
for (int64_t i = 0; i < n; i++) {{
double back[D] = {{0}}, forth[D] = {{0}};
int64_t at = 0;
{" ".join(one)}
for (int64_t k = 0; k < steps; k++) {{ double aim = aims[k];
{TAKE}
double x = deep > 0.0 ? wall_x : free_x, v = deep > 0.0 ? wall_v : free_v;
if (deep > 0.0 ? leaves : enters) {{
x = s_x2; v = s_v2; meet_wall(&sets[i], &x, &v, f2); }}
s_x2 = x; s_v2 = v;
{KEEP} {turn} }}
out[2 * i] = s_sum; out[2 * i + 1] = s_peak;
}} }}
#undef Q
#undef S
#undef BACK
#undef FORTH
#define Q(name) q_##name[l]
#define S(name) s_##name[l]
#define BACK back[at][l]
#define FORTH forth[at][l]
void side_by_side{takes} {{
for (int64_t i = 0; i < n; i += L) {{
double back[D][L] = {{{{0}}}}, forth[D][L] = {{{{0}}}};
double x[L], v[L], push[L];
int64_t at = 0, meets[L];
{" ".join(many)}
for (int64_t l = 0; l < L; l++) {{ {" ".join(load)} }}
for (int64_t k = 0; k < steps; k++) {{ double aim = aims[k]; int64_t any = 0;
for (int64_t l = 0; l < L; l++) {{
{TAKE}
push[l] = f2;
x[l] = deep > 0.0 ? wall_x : free_x; v[l] = deep > 0.0 ? wall_v : free_v;
meets[l] = deep > 0.0 ? leaves : enters;
any |= meets[l];
}}
if (any) for (int64_t l = 0; l < L; l++) if (meets[l]) {{
x[l] = s_x2[l]; v[l] = s_v2[l]; meet_wall(&sets[i + l], &x[l], &v[l], push[l]); }}
for (int64_t l = 0; l < L; l++) {{ s_x2[l] = x[l]; s_v2[l] = v[l]; {KEEP} }}
{turn} }}
for (int64_t l = 0; l < L; l++) {{
out[2 * (i + l)] = s_sum[l]; out[2 * (i + l) + 1] = s_peak[l]; }}
}} }}
"""
