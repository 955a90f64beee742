"""To set up light and camera: quick pictures, coarse bounce."""

import bpy

rebound = bpy.context.scene.rebound

rebound.samples = 16
rebound.viewport_samples = 16
rebound.shadow_resolution = 1024
rebound.viewport_shadow_resolution = 512
rebound.soft_shadows = "FILTERED"
rebound.viewport_soft_shadows = "FILTERED"
rebound.vpl_scale = "QUARTER"
rebound.viewport_vpl_scale = "EIGHTH"
rebound.vpl_resolution = 128
rebound.viewport_vpl_resolution = 128
rebound.vpl_pool = 4096
rebound.viewport_vpl_pool = 2048
rebound.vpl_candidates = 8
rebound.viewport_vpl_candidates = 4
rebound.vpl_bounces = "MANY"
rebound.viewport_vpl_bounces = "ONE"
rebound.vpl_cache_rows = 32
rebound.viewport_vpl_cache_rows = 2
rebound.vpl_voxels = 256
rebound.viewport_vpl_voxels = 128
rebound.viewport_vpl_maps_at_once = 8
rebound.rsm_resolution = 128
rebound.viewport_rsm_resolution = 64
rebound.rsm_gathers = 32
rebound.viewport_rsm_gathers = 16
rebound.rsm_interpolation = "QUARTER"
rebound.viewport_rsm_interpolation = "EIGHTH"
