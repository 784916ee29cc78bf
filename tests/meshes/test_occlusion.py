import numpy as np

from lipmotion_faces.rendering.lighting import reaches


def test_a_floor_under_a_roof_gets_less_light_than_the_floor_beside_it():
    x, z = np.meshgrid(np.linspace(-1, 1, 61), np.linspace(-1, 1, 61))
    floor = np.stack([x, 0 * x, z], axis=-1).reshape(-1, 3)
    roof = np.array([0.4, 0.5, 0.4]) * floor + [0, 0.3, 0]
    places = np.concatenate([floor, roof])
    normals = np.broadcast_to([0.0, 1.0, 0.0], places.shape)
    index = np.arange(61 * 61).reshape(61, 61)
    a, b, c = index[:-1, :-1].ravel(), index[1:, :-1].ravel(), index[1:, 1:].ravel()
    triangles = np.stack([a, b, c], axis=1).astype(np.int32)
    sky, key = reaches(places, normals, triangles, np.ones(len(places), bool)).T[:, : 61 * 61]
    under = (np.abs(floor[:, 0]) < 0.15) & (np.abs(floor[:, 2]) < 0.15)
    beside = (floor[:, 0] > 0.8) & (floor[:, 2] > 0.8)
    assert sky[under].max() < 0.6 * sky[beside].min()
    assert key[beside].min() > 0.9
    shaded = floor[key < 0.5]
    assert len(shaded)
    assert shaded[:, 0].mean() > 0  # the key light comes from -x: shadows fall towards +x
