"""The path tracer of the tutorial: what its steps build, in one file.

Arrays have a row for each ray. The scene is that of a first ray tracing course: a matte, a mirror and a glass
sphere of radius 10 in a room whose floor, ceiling and walls are spheres so large that they look flat.
"""

import numpy as np

# ----- step 1: rays and spheres -----
FAR = 1000.0
ROOM = [(0, -FAR, 0), (0, FAR, 0), (-FAR, 0, 0), (FAR, 0, 0), (0, 0, -FAR), (0, 0, FAR)]
CENTER = np.array(
    [*ROOM, (-21, 0, -4), (0, 0, -18), (20, 0, -4), (-15, 35, 25)]
)  # matte, mirror, glass, lamp
RADIUS = np.array([990.0, 950, 955, 955, 950, 925, 10, 10, 10, 5])
EYE, TARGET, FIELD = np.array([0.0, 8, 55]), np.array([0.0, 5, 0]), np.radians(60)


def dot(a, b):
    return (a * b).sum(-1, keepdims=True)


def unit(a):
    return a / np.sqrt(dot(a, a))


def camera_rays(width, height, rng):
    y, x = np.mgrid[0:height, 0:width].reshape(2, -1) + rng.random((2, width * height))
    up = 2 * np.tan(FIELD / 2) * (0.5 - y / height)
    right = 2 * np.tan(FIELD / 2) * (x - width / 2) / height
    forward = unit(TARGET - EYE)
    sideways = unit(np.cross(forward, (0, 1, 0)))
    across = np.cross(sideways, forward)
    direction = unit(forward + right[:, None] * sideways + up[:, None] * across)
    return np.broadcast_to(EYE, direction.shape), direction


def intersect(origin, direction):
    b = dot(origin, direction) - direction @ CENTER.T
    c = dot(origin, origin) - 2 * origin @ CENTER.T + dot(CENTER, CENTER)[:, 0] - RADIUS**2
    root = np.sqrt(np.maximum(b * b - c, 0))
    t = np.where(-b - root > 1e-4, -b - root, -b + root)  # the far side where the ray starts inside
    t[(b * b < c) | (t < 1e-4)] = np.inf
    which = t.argmin(1)
    nearest = np.take_along_axis(t, which[:, None], 1)
    missed = np.isinf(nearest)
    return np.where(missed, 0, nearest), np.where(missed[:, 0], -1, which)


def normal_at(point, which):
    return unit(point - CENTER[which])


# ----- step 2: light and color -----
WALLS = [(0.75, 0.75, 0.75), (0.85, 0.85, 0.85), (0.75, 0.25, 0.25)]  # floor, ceiling, left
WALLS += [(0.25, 0.35, 0.75), (0.35, 0.7, 0.4), (0.75, 0.45, 0.7)]  # right, back, behind the camera
# the last row is that of a ray that meets nothing, whose number is -1
COLOR = np.array([*WALLS, (0.9, 0.6, 0.2), (0.95, 0.95, 0.95), (1, 1, 1), (0, 0, 0), (0, 0, 0)])
LAMP, POINT_INTENSITY = 9, 3500.0


def point_light(point, normal, color):
    towards = CENTER[LAMP] - point
    distance = np.sqrt(dot(towards, towards))
    towards = towards / distance
    cos = np.maximum(dot(normal, towards), 0)
    seen = (intersect(point, towards)[1] == LAMP)[:, None]
    return color / np.pi * POINT_INTENSITY / distance**2 * cos * seen


def picture(radiance, width, height):
    codes = np.clip(radiance, 0, 1) ** (1 / 2.2)
    return (255 * codes.reshape(height, width, 3) + 0.5).astype(np.uint8)


# ----- step 3: mirrors and glass -----
MATTE, MIRROR, GLASS = 0, 1, 2
KIND = np.array([MATTE] * 6 + [MATTE, MIRROR, GLASS, MATTE, MATTE])


def reflect(direction, normal):
    return direction - 2 * dot(direction, normal) * normal


def through_glass(direction, normal, rng, index=1.5):
    cos = -dot(direction, normal)
    normal = np.where(cos > 0, normal, -normal)  # towards the ray
    ratio = np.where(cos > 0, 1 / index, index)
    cos = np.abs(cos)
    behind = np.sqrt(np.maximum(1 - ratio**2 * (1 - cos**2), 0))  # 0: total reflection
    s = (ratio * cos - behind) / (ratio * cos + behind)
    p = (ratio * behind - cos) / (ratio * behind + cos)
    reflected = rng.random(cos.shape) < (s**2 + p**2) / 2
    refracted = ratio * direction + (ratio * cos - behind) * normal
    return np.where(reflected, reflect(direction, normal), unit(refracted))


# ----- step 4: importance sampling -----
def cosine_directions(u):
    phi, radius = 2 * np.pi * u[0], np.sqrt(1 - u[1])
    return np.stack([np.cos(phi) * radius, np.sin(phi) * radius, np.sqrt(u[1])], -1)


def around(normal, local):
    helper = np.where(np.abs(normal[:, :1]) > 0.9, (0.0, 1.0, 0.0), (1.0, 0.0, 0.0))
    tangent = unit(np.cross(helper, normal))
    return local[:, :1] * tangent + local[:, 1:2] * np.cross(normal, tangent) + local[:, 2:] * normal


def scatter(direction, normal, which, rng):
    """Return the next directions, f·cosθ/p, and the densities p, which are infinite for mirrors and glass."""
    local = cosine_directions(rng.random((2, len(which))))
    following, pdf = around(normal, local), local[:, 2:] / np.pi
    for kind, turn in ((MIRROR, reflect), (GLASS, lambda d, n: through_glass(d, n, rng))):
        these = KIND[which] == kind
        following[these], pdf[these] = turn(direction[these], normal[these]), np.inf
    return following, COLOR[which], pdf


def render(estimator, width, height, paths, seed=0):
    """Return the mean of so many paths for each pixel, (width · height, 3)."""
    rng, total = np.random.default_rng(seed), 0
    for _ in range(paths):
        total = total + estimator(*camera_rays(width, height, rng), rng)
    return total / paths


# ----- step 5: a lamp that has a size -----
EMISSION = np.zeros((len(COLOR), 3))
EMISSION[LAMP] = POINT_INTENSITY / (np.pi * RADIUS[LAMP] ** 2)  # so that it shines as the point did


def naive(origin, direction, rng, bounces=5):
    light, throughput = 0, 1
    for _ in range(bounces + 1):
        distance, which = intersect(origin, direction)
        light = light + throughput * EMISSION[which]
        origin = origin + distance * direction
        direction, factor, _ = scatter(direction, normal_at(origin, which), which, rng)
        throughput = throughput * factor
    return light


# ----- step 6: light samples -----
def lamp_cone(point):
    towards = CENTER[LAMP] - point
    squared = dot(towards, towards)
    return towards / np.sqrt(squared), np.sqrt(np.maximum(1 - RADIUS[LAMP] ** 2 / squared, 0))


def lamp_pdf(point):
    return 1 / (2 * np.pi * (1 - lamp_cone(point)[1]))


def light_sample(point, normal, color, rng):
    """Return f·Le·cosθ/p for a direction to the lamp, and that direction."""
    axis, edge = lamp_cone(point)
    u = rng.random((2, len(point), 1))
    cos, phi = 1 - u[1] * (1 - edge), 2 * np.pi * u[0]
    sin = np.sqrt(1 - cos**2)
    towards = around(axis, np.concatenate([np.cos(phi) * sin, np.sin(phi) * sin, cos], 1))
    seen = (intersect(point, towards)[1] == LAMP)[:, None]
    cos = np.maximum(dot(normal, towards), 0)
    return color / np.pi * EMISSION[LAMP] * cos * seen / lamp_pdf(point), towards


# ----- step 7: multiple importance sampling -----
def power(p, q):
    return np.where(np.isinf(p), 1, p**2 / (np.where(np.isinf(p), 1, p) ** 2 + q**2))


# ----- step 8: everything -----
def full(origin, direction, rng, bounces=5, first_roulette=2):
    light, slot = np.zeros(origin.shape), np.arange(len(origin))
    throughput, pdf = np.ones(origin.shape), np.full((len(origin), 1), np.inf)
    for bounce in range(bounces + 1):
        distance, which = intersect(origin, direction)
        light[slot] += throughput * EMISSION[which] * power(pdf, lamp_pdf(origin))
        if bounce == bounces:
            break
        origin = origin + distance * direction
        normal = normal_at(origin, which)
        matte = (KIND[which] == MATTE)[:, None]
        sample, towards = light_sample(origin, normal, COLOR[which], rng)
        other = np.maximum(dot(normal, towards), 0) / np.pi
        light[slot] += throughput * sample * power(lamp_pdf(origin), other) * matte
        direction, factor, pdf = scatter(direction, normal, which, rng)
        throughput = throughput * factor
        stay = throughput.max(1) if bounce >= first_roulette else (throughput.max(1) > 0).astype(float)
        alive = np.flatnonzero(rng.random(len(slot)) < stay)
        throughput = throughput[alive] / np.minimum(stay[alive], 1)[:, None]
        slot, origin, direction, pdf = slot[alive], origin[alive], direction[alive], pdf[alive]
    return light
