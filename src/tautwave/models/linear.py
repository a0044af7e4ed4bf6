"""Exact motion of a damped mass on a spring under a force that grows linearly.

`m a + b v + k x = force + slope t`. Everything is written for increments and for the net force
`n = force - k x - b v` that accelerates the mass at the start: `v' = n / m`,
`n' = slope - k v - b n / m`. In these variables neither the place of the origin nor a large
spring force that is balanced costs digits. Long steps are built by doubling short ones, so
stiff and heavily damped systems cost the logarithm of their rate.
"""

from __future__ import annotations

import math

_SHORT = 0.25  # greatest rate * step of a series; larger steps are doubled from it
_TERMS = 20
_DOUBLINGS = 80  # ends the search for a short step when a rate has overflowed
_ALL_SEEN = 6  # from this term on every sum of a series has had its leading one
_NOTHING = 1e-17  # a term below this share of its sum changes no bit of it, nor do those behind

NineRows = tuple[float, float, float, float, float, float, float, float, float]
TwelveRows = tuple[
    float, float, float, float, float, float, float, float, float, float, float, float
]
Form = tuple[float, float, float, float, float, float]
FlowCoefficients = tuple[
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
]


def _doublings(stiffness: float, damping: float, mass: float, t: float) -> int:
    """Return how often `t` has to be halved until a Taylor series in it converges fast."""
    rate = math.sqrt(stiffness / mass)
    if damping / mass > rate:
        rate = damping / mass
    norm = rate * t
    count = 0
    while norm > _SHORT and count < _DOUBLINGS:
        norm = 0.5 * norm
        count = count + 1
    return count


def _short_rows(stiffness: float, damping: float, mass: float, t: float) -> TwelveRows:
    """Rows (over v, n, slope) of the increments of x, v, the area under x, and n; short `t`."""
    decay = damping / mass
    # Row functionals of the i-th derivative of v, times t**i / i!, summed with their integrals.
    a = 1.0
    b = 0.0
    c = 0.0
    vv = 0.0
    vn = 0.0
    vs = 0.0
    xv = 1.0
    xn = 0.0
    xs = 0.0
    iv = 0.5
    jn = 0.0
    js = 0.0
    edge = _NOTHING * t / mass
    for i in range(1, _TERMS):
        if (
            -edge <= b <= edge
            and i > _ALL_SEEN
            and math.fabs(a) <= _NOTHING * math.fabs(vv)
            and math.fabs(b) <= _NOTHING * math.fabs(vn)
            and math.fabs(c) <= _NOTHING * math.fabs(vs)
        ):
            break
        scale = t / i
        d = -stiffness * b * scale
        e = (a / mass - decay * b) * scale
        c = b * scale
        a = d
        b = e
        vv = vv + a
        vn = vn + b
        vs = vs + c
        first = 1.0 / (i + 1.0)
        xv = xv + a * first
        xn = xn + b * first
        xs = xs + c * first
        second = first / (i + 2.0)
        iv = iv + a * second
        jn = jn + b * second
        js = js + c * second
    xv = xv * t
    xn = xn * t
    xs = xs * t
    square = t * t
    nv = -stiffness * xv - damping * vv
    nn = -stiffness * xn - damping * vn
    ns = t - stiffness * xs - damping * vs
    return (xv, xn, xs, vv, vn, vs, iv * square, jn * square, js * square, nv, nn, ns)


def _double_rows(
    t: float,
    xv: float,
    xn: float,
    xs: float,
    vv: float,
    vn: float,
    vs: float,
    iv: float,
    jn: float,
    js: float,
    nv: float,
    nn: float,
    ns: float,
) -> TwelveRows:
    """Rows for `2 t` from those for `t`; increments stay increments, so slow modes keep digits."""
    return (
        2.0 * xv + (xv * vv + xn * nv),
        2.0 * xn + (xv * vn + xn * nn),
        2.0 * xs + (xv * vs + xn * ns),
        2.0 * vv + (vv * vv + vn * nv),
        2.0 * vn + (vv * vn + vn * nn),
        2.0 * vs + (vv * vs + vn * ns),
        2.0 * iv + t * xv + (iv * vv + jn * nv),
        2.0 * jn + t * xn + (iv * vn + jn * nn),
        2.0 * js + t * xs + (iv * vs + jn * ns),
        2.0 * nv + (nv * vv + nn * nv),
        2.0 * nn + (nv * vn + nn * nn),
        2.0 * ns + (nv * vs + nn * ns),
    )


def flow_rows(stiffness: float, damping: float, mass: float, t: float) -> NineRows:
    """Linear map of one step of length `t` [s] over (v, n, slope).

    Returns
    -------
    tuple of 9 floats
        Coefficients of the increment of x, of the increment of v, and of the integral of
        `x - x(0)`; `n = force - stiffness x - damping v` at the start.
    """
    count = _doublings(stiffness, damping, mass, t)
    part = t
    for _ in range(count):
        part = 0.5 * part
    xv, xn, xs, vv, vn, vs, iv, jn, js, nv, nn, ns = _short_rows(stiffness, damping, mass, part)
    for _ in range(count):
        xv, xn, xs, vv, vn, vs, iv, jn, js, nv, nn, ns = _double_rows(
            part, xv, xn, xs, vv, vn, vs, iv, jn, js, nv, nn, ns
        )
        part = 2.0 * part
    return xv, xn, xs, vv, vn, vs, iv, jn, js


def _short_form(stiffness: float, damping: float, mass: float, t: float) -> Form:
    """Symmetric matrix (vv, vn, vs, nn, ns, ss) of the integral of v**2 over a short `t`."""
    decay = damping / mass
    # Taylor series of Q' = A'Q + QA + C, the Lyapunov equation of the integral.
    a = t
    b = 0.0
    c = 0.0
    d = 0.0
    e = 0.0
    f = 0.0
    qvv = t
    qvn = 0.0
    qvs = 0.0
    qnn = 0.0
    qns = 0.0
    qss = 0.0
    edge = _NOTHING * t
    for i in range(2, _TERMS + 3):
        if (
            -edge <= a <= edge
            and i > _ALL_SEEN
            and math.fabs(a) <= _NOTHING * math.fabs(qvv)
            and math.fabs(b) <= _NOTHING * math.fabs(qvn)
            and math.fabs(c) <= _NOTHING * math.fabs(qvs)
            and math.fabs(d) <= _NOTHING * math.fabs(qnn)
            and math.fabs(e) <= _NOTHING * math.fabs(qns)
            and math.fabs(f) <= _NOTHING * math.fabs(qss)
        ):
            break
        scale = t / i
        ra = -2.0 * stiffness * b * scale
        rb = (a / mass - stiffness * d - decay * b) * scale
        rc = (b - stiffness * e) * scale
        rd = 2.0 * (b / mass - decay * d) * scale
        re = (c / mass + d - decay * e) * scale
        f = 2.0 * e * scale
        a = ra
        b = rb
        c = rc
        d = rd
        e = re
        qvv = qvv + a
        qvn = qvn + b
        qvs = qvs + c
        qnn = qnn + d
        qns = qns + e
        qss = qss + f
    return qvv, qvn, qvs, qnn, qns, qss


def flow_coefficients(stiffness: float, damping: float, mass: float, h: float) -> FlowCoefficients:
    """Everything a full step of length `h` [s] needs, as 15 coefficients.

    Returns
    -------
    tuple of 15 floats
        The 9 of `flow_rows`, then the quadratic form of the integral of v**2 over (v, n, slope):
        coefficients of v v, v n, v slope, n n, n slope, slope slope (mixed ones already doubled).
    """
    count = _doublings(stiffness, damping, mass, h)
    part = h
    for _ in range(count):
        part = 0.5 * part
    xv, xn, xs, vv, vn, vs, iv, jn, js, nv, nn, ns = _short_rows(stiffness, damping, mass, part)
    qvv, qvn, qvs, qnn, qns, qss = _short_form(stiffness, damping, mass, part)
    for _ in range(count):
        # Q(2t) = Q + M' Q M with M the map of (v, n, slope), whose last row is (0, 0, 1).
        mvv = 1.0 + vv
        mnn = 1.0 + nn
        av = qvv * mvv + qvn * nv
        an = qvn * mvv + qnn * nv
        bv = qvv * vn + qvn * mnn
        bn = qvn * vn + qnn * mnn
        cv = qvv * vs + qvn * ns + qvs
        cn = qvn * vs + qnn * ns + qns
        cs = qvs * vs + qns * ns + qss
        qss = qss + (vs * cv + ns * cn + cs)
        qvv = qvv + (mvv * av + nv * an)
        qns = qns + (vn * cv + mnn * cn)
        qvs = qvs + (mvv * cv + nv * cn)
        qvn = qvn + (mvv * bv + nv * bn)
        qnn = qnn + (vn * bv + mnn * bn)
        xv, xn, xs, vv, vn, vs, iv, jn, js, nv, nn, ns = _double_rows(
            part, xv, xn, xs, vv, vn, vs, iv, jn, js, nv, nn, ns
        )
        part = 2.0 * part
    return (xv, xn, xs, vv, vn, vs, iv, jn, js, qvv, 2.0 * qvn, 2.0 * qvs, qnn, 2.0 * qns, qss)


def flow_increment(
    stiffness: float, damping: float, mass: float, v: float, net: float, slope: float, t: float
) -> tuple[float, float, float]:
    """Return the change of x, the new v and the new net force after `t` [s]; for root searches."""
    if t == 0.0:
        return 0.0, v, net
    decay = damping / mass
    rate = math.sqrt(stiffness / mass)
    if decay > rate:
        rate = decay
    if rate * t > 2.0 * _SHORT:
        xv, xn, xs, vv, vn, vs, _, _, _ = flow_rows(stiffness, damping, mass, t)
        moved = xv * v + xn * net + xs * slope
        gained = vv * v + vn * net + vs * slope
    else:
        drag = damping * t / mass
        pull = stiffness * t * t / mass
        last = v
        term = net * t / mass
        push = slope * t * t / mass
        tiny = 1e-18 * (math.fabs(last) + math.fabs(term) + math.fabs(push))
        moved = last + 0.5 * term
        gained = term
        for i in range(2, _TERMS):
            before = i - 1.0
            following = (push - drag * before * term - pull * last) / (i * before)
            push = 0.0
            last = term
            term = following
            gained = gained + term
            moved = moved + term / (i + 1.0)
            if -tiny < term < tiny and math.fabs(last) + math.fabs(term) < tiny:
                break
        moved = moved * t
    return moved, v + gained, net + (slope * t - stiffness * moved - damping * gained)


def linear_flow(
    stiffness: float,
    damping: float,
    mass: float,
    force: float,
    slope: float,
    x: float,
    v: float,
    t: float,
) -> tuple[float, float, float]:
    """Exact motion of `mass a + damping v + stiffness x = force + slope t` over `t` [s].

    Returns
    -------
    tuple
        Position, velocity, and the integral of the position over the time.
    """
    xv, xn, xs, vv, vn, vs, iv, jn, js = flow_rows(stiffness, damping, mass, t)
    net = force - stiffness * x - damping * v
    return (
        x + (xv * v + xn * net + xs * slope),
        v + (vv * v + vn * net + vs * slope),
        x * t + (iv * v + jn * net + js * slope),
    )
