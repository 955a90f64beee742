"""The session fixture brings up the GPU at module level."""

import gpu


def test_gpu_makes_a_texture_after_start(gpu_backend, clean_scene):
    texture = gpu.types.GPUTexture((4, 4), format="RGBA32F")
    assert (texture.width, texture.height) == (4, 4)
