"""The defaults: a clean picture of most scenes."""

import bpy

rebound = bpy.context.scene.rebound

rebound.samples = 64
rebound.viewport_samples = 32
rebound.shadow_resolution = 2048
rebound.viewport_shadow_resolution = 1024
rebound.soft_shadows = "SAMPLED"
rebound.viewport_soft_shadows = "FILTERED"
rebound.vpl_scale = "HALF"
rebound.viewport_vpl_scale = "QUARTER"
rebound.vpl_resolution = 256
rebound.viewport_vpl_resolution = 256
rebound.vpl_pool = 8192
rebound.viewport_vpl_pool = 4096
rebound.vpl_candidates = 16
rebound.viewport_vpl_candidates = 8
rebound.vpl_bounces = "MANY"
rebound.viewport_vpl_bounces = "MANY"
rebound.vpl_cache_rows = 64
rebound.viewport_vpl_cache_rows = 4
rebound.vpl_voxels = 512
rebound.viewport_vpl_voxels = 256
rebound.viewport_vpl_maps_at_once = 16
rebound.rsm_resolution = 256
rebound.viewport_rsm_resolution = 128
rebound.rsm_gathers = 64
rebound.viewport_rsm_gathers = 32
rebound.rsm_interpolation = "OFF"
rebound.viewport_rsm_interpolation = "QUARTER"
