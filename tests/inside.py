"""What tests use of the inside of the package: where it stands is known here alone."""

# ruff: noqa: F401
from wavefront.accel import coplanar, instances, triangle
from wavefront.accel.apart import ApartAccelerator, build_apart, still_triangles
from wavefront.accel.balls import MOST, BoundingBalls, bounding_balls
from wavefront.accel.base import Accelerator, Geometry, Intersections
from wavefront.accel.brute_force import BruteForceTriangles
from wavefront.accel.build import build_tree, stable_order
from wavefront.accel.capsule import CapsulePrimitives
from wavefront.accel.counter import RayCounter
from wavefront.accel.cylinder import CylinderPrimitives
from wavefront.accel.deforming import DeformingAccelerator, SweptSpheres, SweptTriangles, joined_steps
from wavefront.accel.distance_grid import DistanceGridPrimitives, _first_root
from wavefront.accel.embree import installed
from wavefront.accel.instances import InstanceAccelerator
from wavefront.accel.numpy_accel import SMALL, NumpyAccelerator
from wavefront.accel.plate import Plate, PlateAccelerator, beside_plate, surely_occluded
from wavefront.accel.primitives import CurvedPrimitives
from wavefront.accel.quads import are_parallelograms, corners, find_quads
from wavefront.accel.registry import ACCELERATORS, make_accelerator
from wavefront.accel.search import PrimitiveTree
from wavefront.accel.sphere import SpherePrimitives
from wavefront.arrays import elementary
from wavefront.arrays.frame import Frame
from wavefront.arrays.soa import soa
from wavefront.arrays.state import Hits, Paths, Rays, SurfaceInteraction
from wavefront.arrays.vec import ALL as ARRAYS_ALL
from wavefront.arrays.vec import (
    INV_PI,
    Floats,
    broadcast,
    column,
    cross,
    dot,
    f4,
    highest,
    length,
    luminance,
    normalize,
)
from wavefront.bsdfs import ALL as BSDFS_ALL
from wavefront.bsdfs.albedo import (
    SIZE,
    _dielectric_tables,
    cosine_mean,
    dielectric_albedo,
    gloss_tables,
    lookup,
)
from wavefront.bsdfs.base import Bsdf, BsdfSample, albedo_of, weigh
from wavefront.bsdfs.conductor import METALS as BSDFS_METALS
from wavefront.bsdfs.conductor import Conductor
from wavefront.bsdfs.dielectric import Dielectric
from wavefront.bsdfs.diffuse import Diffuse
from wavefront.bsdfs.diffuse_transmission import DiffuseTransmission
from wavefront.bsdfs.disney import Disney
from wavefront.bsdfs.disney_thin import ThinDisney
from wavefront.bsdfs.energy import Shape, gain, loss, mean_over_cosines, part_kept, scaling
from wavefront.bsdfs.fresnel import fresnel_conductor, fresnel_dielectric
from wavefront.bsdfs.fuzz import _transformation, fuzz_albedo, fuzz_directions, fuzz_lobe
from wavefront.bsdfs.layers.coat import Varnish
from wavefront.bsdfs.layers.layers import LayeredBsdf
from wavefront.bsdfs.measured import UP, Measured, _coordinates, _elevation, _turned
from wavefront.bsdfs.microfacet import Facets, alpha_of, is_smooth, reflect, refract
from wavefront.bsdfs.mirror import Mirror
from wavefront.bsdfs.mix import Mix
from wavefront.bsdfs.openpbr import OpenPBRBsdf, weighted_index
from wavefront.bsdfs.oren_nayar import OrenNayar
from wavefront.bsdfs.plastic import Plastic, boundary_tables, part_escaping
from wavefront.bsdfs.principled import Principled
from wavefront.bsdfs.rough import Microfacets, RoughBsdf, Tangent
from wavefront.bsdfs.shadow_catcher import ShadowCatcher
from wavefront.bsdfs.sheen import _albedo_table, fiber_density, sheen_albedo, sheen_lobe
from wavefront.bsdfs.sides import Sides
from wavefront.bsdfs.thin import ThinDielectric
from wavefront.bsdfs.thin_film import GAUSSIANS, WHITE, XYZ_TO_RGB, film_reflectance
from wavefront.bsdfs.thin_film import SHARES as BSDFS_SHARES
from wavefront.camera.base import Camera
from wavefront.camera.distortion import Distortion
from wavefront.camera.mappings import MAPPINGS, Polynomial
from wavefront.camera.projection import Orthographic, Panorama, Perspective
from wavefront.camera.sensors import Sensors
from wavefront.cli import command_line, doctor_command, render_command
from wavefront.cli.command_line import main
from wavefront.cli.doctor_command import EXTRAS
from wavefront.cli.options import RENDER_OPTIONS, flow_times, joined
from wavefront.codecs import hdr, npz, png_jpeg, raster
from wavefront.codecs.budget import Budget as codecs_Budget
from wavefront.codecs.display import Display
from wavefront.codecs.encoding import to_codes
from wavefront.codecs.flow import kitti_file
from wavefront.codecs.image_data import ImageData, from_named
from wavefront.codecs.images import check_writable, decode_codes, read_image, read_picture, write_image
from wavefront.codecs.luminaires import Photometry, luminaire_texts, parsed_luminaire
from wavefront.codecs.tone import AGX_IN, AGX_OUT, TONES, aces, agx, agx_punchy, reinhard
from wavefront.codecs.white_balance import NEUTRAL, XYZ_OF_RGB, white_balance_matrix
from wavefront.colors import colormaps
from wavefront.colors.maps import color_map
from wavefront.colors.primaries import REC_709, rgb_to_xyz, to_srgb
from wavefront.colors.spectrum import Y_INTEGRAL, blackbody_colors, blackbody_spectrum, spectrum_rgb
from wavefront.colors.transfer import linear_to_srgb, srgb_to_linear
from wavefront.compile import absorption, scene
from wavefront.compile.brightest import brightest_emitter
from wavefront.compile.exposure import exposed_scene
from wavefront.compile.materials import group_materials
from wavefront.compile.media import PhaseBsdf
from wavefront.compile.morton import BITS, MortonGrid
from wavefront.compile.program import Feature, Program
from wavefront.compile.scale import MAX_DISTANCE, MAX_RADIUS, MIN_RADIUS, length_factor, scaled_shapes
from wavefront.compile.scene import ROULETTE_AFTER, CompiledScene
from wavefront.compile.specular_surfaces import SpecularSurfaces
from wavefront.core import files, interrupt, progress
from wavefront.core.errors import SaveError, SceneError, exact, plain, warn_caller
from wavefront.core.fingerprint import fingerprint
from wavefront.core.interrupt import InterruptHandler, deferred_signals
from wavefront.core.memory import available_memory, check_memory, memory_size, resident_memory
from wavefront.core.npz import npz_chunks, open_npz, read_array
from wavefront.core.plural import plural
from wavefront.core.progress import DELAY, Bar, phase
from wavefront.core.registry import Registry
from wavefront.core.shared import AT_ONCE, STOP, SharedInt, Stopped
from wavefront.core.suggestions import SYNONYMS, meant, suggests_keywords
from wavefront.datasets import dataset
from wavefront.datasets.annotated import annotated_objects
from wavefront.datasets.masks import mask_box, run_lengths
from wavefront.datasets.models import diameter, write_models
from wavefront.denoising import nonlocal_means as denoising_nonlocal_means
from wavefront.denoising import open_image_denoise
from wavefront.denoising.noisy import Guide, NoisyPicture, noisy_picture, without_holes
from wavefront.denoising.nonlocal_means import nonlocal_means as nonlocal_means_nonlocal_means
from wavefront.drive import (
    choice,
    final_checks,
    hints,
    inline,
    jobs,
    notebook,
    plan,
    prepared_scene,
    session,
    tracing,
)
from wavefront.drive.jobs import (
    LARGE_WAVE,
    MIN_SPP,
    QUICK_SPP,
    SMALL_WAVE,
    SQUARE,
    CameraJob,
    JobResult,
    Pass,
    Scheduler,
    next_stop,
    passes,
    passes_until_clean,
    split_jobs,
)
from wavefront.drive.jobs import Job as drive_Job
from wavefront.drive.notebook import in_kernel, run_shown, shows_pictures
from wavefront.drive.plan import (
    LANE_BYTES,
    LEAST_WAVE,
    PROCESS_BYTES,
    THREAD_BYTES,
    make_budget,
    picture_memory,
)
from wavefront.drive.plan import Budget as drive_Budget
from wavefront.features import compiling
from wavefront.features.absorption import Absorption
from wavefront.features.alpha import Alpha
from wavefront.features.background import Backdrop, Background
from wavefront.features.black_lights import BlackLights
from wavefront.features.branches import Branches
from wavefront.features.caustics import Caustics
from wavefront.features.compiling import compile_scene
from wavefront.features.dispersion import Dispersion
from wavefront.features.instances import Instances
from wavefront.features.interpolation import Interpolation, SmoothNormals
from wavefront.features.media import Glow, Media
from wavefront.features.motion import Deformations, Moments, Motion
from wavefront.features.nested import Nested
from wavefront.features.normal_maps import MappedShading, NormalMaps, _folded
from wavefront.features.passing import Passing
from wavefront.features.receivers import Receivers
from wavefront.features.shadow_catchers import ShadowCatchers
from wavefront.features.shadow_terminator import ShadowTerminator, heights_of
from wavefront.features.unseen import Unseen
from wavefront.features.view import seen_by, seen_with
from wavefront.film import aov_sums, checkpoint
from wavefront.film.aov_names import AOVS, BRIGHTEST, NARROW
from wavefront.film.checkpoint import HEADER, read_header
from wavefront.film.exact_sum import WIDTH, ExactSums
from wavefront.film.film import OUTLIERS as FILM_OUTLIERS
from wavefront.film.film import Film, batch_size
from wavefront.film.light_sums import LightSums
from wavefront.film.picture_sums import PictureSums, empty_sums
from wavefront.film.samples import shared_samples
from wavefront.film.sums import Sums, bytes_per_pixel
from wavefront.guiding.cells import GuideCells
from wavefront.guiding.guide_table import GuideTable
from wavefront.guiding.octahedral import bins_of, directions_at, neighbors, solid_angles
from wavefront.guiding.training import SHARES as GUIDING_SHARES
from wavefront.guiding.training import SIDE as GUIDING_SIDE
from wavefront.guiding.training import Records, _best_shares, build_table
from wavefront.image.comparison import _estimate
from wavefront.image.image import Image, film_image
from wavefront.image.plot import id_colors
from wavefront.integrators import steps, training, tuning
from wavefront.integrators.ladder import li_full
from wavefront.integrators.light_tracing import Splats, trace_light
from wavefront.integrators.shared_paths import li_reuse
from wavefront.integrators.stage_list import ORDER
from wavefront.integrators.steps import intersect_and_compact, prepare_shading
from wavefront.integrators.training import train
from wavefront.integrators.tuning import BLOCKS, SAMPLES, Run, li_twins, tuning_run
from wavefront.integrators.tuning import OUTLIERS as INTEGRATORS_OUTLIERS
from wavefront.io import obj, readers
from wavefront.io.description import placing
from wavefront.io.description.conversion import Conversion
from wavefront.io.description.entity import Entity, Table
from wavefront.io.description.placing import facing
from wavefront.io.gltf import document
from wavefront.io.gltf.compression import claimed
from wavefront.io.gltf.materials import KNOWN
from wavefront.io.gltf.posing import Bend, Skin, pose
from wavefront.io.load import from_trimesh, load, load_mesh, load_meshes
from wavefront.io.losses import Losses
from wavefront.io.materialx import load_materialx
from wavefront.io.mitsuba import convert
from wavefront.io.mitsuba.document import Document
from wavefront.io.mitsuba.nodes import TABLE as NODES_TABLE
from wavefront.io.mitsuba.nodes import Job as io_Job
from wavefront.io.pbrt.entities import TABLE as ENTITIES_TABLE
from wavefront.io.pbrt.lights import sphere_to_square, square_to_sphere
from wavefront.io.pbrt.noise import noise
from wavefront.io.pbrt.parser import Statement, statements
from wavefront.io.polygons import fans, fans_by_size, triangulate, turned_fans
from wavefront.io.pyvista.objects import from_pyvista
from wavefront.io.repair import RawMesh
from wavefront.io.sources import LoadLimits, SceneFiles
from wavefront.io.spectra import METALS as IO_METALS
from wavefront.io.text_lines import NUMBER
from wavefront.io.usd.child import CHILD, Child
from wavefront.io.volume_libraries import openvdb
from wavefront.io.volumes import load_grid
from wavefront.lights import grid, hosek_wilkie, samplers, sky_functions, textured_emission
from wavefront.lights.base import Emitters, LightRecord, LightSample, Receiver
from wavefront.lights.choice import LightSampler
from wavefront.lights.directional import DirectionalLight, DirectionalLights, SunLight
from wavefront.lights.environment import ConstantEnvironment, Environment
from wavefront.lights.glow import GlowLights
from wavefront.lights.grid import BY_POWER, SpatialLightSampler
from wavefront.lights.ies import IESLight, IESLights, Web
from wavefront.lights.image import LEAST_VARIANCE, ImageEnvironment
from wavefront.lights.infinite import EnvironmentSum
from wavefront.lights.moving import DeformingLights, MovingLights
from wavefront.lights.octahedral import SHARP, OctahedralEnvironment, _directions, _texels
from wavefront.lights.octahedral import SIDE as LIGHTS_SIDE
from wavefront.lights.patches import PatchedEnvironment, SkyPatches
from wavefront.lights.point import PointLight, PointLightRecord
from wavefront.lights.product import (
    NO_NORMAL,
    CosineProduct,
    TexelProduct,
    octahedral_bins,
    octahedral_normals,
)
from wavefront.lights.rectangle import RectangleLights, TwoSidedRectangleLights, first_of_pairs
from wavefront.lights.samplers import (
    LIGHT_SAMPLERS,
    HalvedLightSampler,
    SubsetLightSampler,
    WeightedLightSampler,
)
from wavefront.lights.sky import SkyLight
from wavefront.lights.sky_functions import cie_function
from wavefront.lights.sphere import SphereLights
from wavefront.lights.spot import PicturedLights, SpotLight, SpotLights
from wavefront.lights.table import IrradianceOf, LightTable
from wavefront.lights.textured_emission import TexturedTriangleLights, TwoSidedTexturedTriangleLights
from wavefront.lights.textured_sphere import TexturedSphereLights
from wavefront.lights.tree import LightTreeSampler
from wavefront.lights.triangle import FEW, TriangleLights, TwoSidedTriangleLights
from wavefront.lights.turning import TurningLight
from wavefront.material_ball import ball_png
from wavefront.materials.material import Material, as_material
from wavefront.materials.named import NAMED_MATERIALS
from wavefront.measuring.points import load_points
from wavefront.measuring.weather import load_weather
from wavefront.measuring.weather import product as measuring_product
from wavefront.media.base import MediumRays
from wavefront.media.grid import survivors
from wavefront.media.marching import March
from wavefront.media.phase import HenyeyGreenstein, deflected
from wavefront.media.voxels import Voxels, bounds_in_cells
from wavefront.motion.deformation import Deformation
from wavefront.motion.keyframes import Trs
from wavefront.motion.product import Inverse, Product
from wavefront.motion.product import product as motion_product
from wavefront.motion.quaternions import polar, quaternions_of, rotation_of, slerp
from wavefront.motion.shutter import Shutter
from wavefront.motion.steps import Motions
from wavefront.motion.together import Together
from wavefront.motion.track import CUBIC, LINEAR, STEP, Track
from wavefront.motion.turn import Turn
from wavefront.sampling import filters, sampler, tiles, warp
from wavefront.sampling.bilinear import BilinearDensity
from wavefront.sampling.discrete import Discrete, Distribution2D
from wavefront.sampling.filters import FILTERS
from wavefront.sampling.mis import power_heuristic
from wavefront.sampling.sampler import (
    BLOCK,
    SAMPLERS,
    VARIANTS,
    BlueNoiseSampler,
    Dimension,
    IndependentSampler,
    Sampler,
    SobolSampler,
    _mix_longs,
    _stream,
    make_sampler,
    numbers_of,
)
from wavefront.sampling.spherical import SphericalRectangle
from wavefront.sampling.steps import StepNumbers
from wavefront.sampling.tiles import (
    MEMBERS,
    PictureTiles,
    PointTiles,
    WaveTiles,
    nearby_ranks,
    others_in_tile,
    pixels_of_tiles,
    place_in_tiles,
)
from wavefront.sampling.warp import cosine_hemisphere, cosine_hemisphere_inverse, uniform_sphere
from wavefront.scene import lighting
from wavefront.scene.lighting import LIGHTINGS, PRESETS, lighted
from wavefront.scene.scene import VIEWS, Scene
from wavefront.scene.state import scene_state
from wavefront.settings import SETTINGS
from wavefront.settings.checks import EXCLUSIONS, MEDIA, MOVING_IN_TURN, ROLLING, SETTING_OF, Exclusion, table
from wavefront.settings.settings import DEFAULT_SPP, LITTLE_NOISE, Settings
from wavefront.shapes.instance import Instance, can_place, instance_bounds, kinds_of
from wavefront.shapes.mesh import Mesh
from wavefront.shapes.plate import FACES, plate
from wavefront.shapes.segments import Cylinders
from wavefront.shapes.smoothing import crease_normals
from wavefront.shapes.sphere import Sphere
from wavefront.shapes.spheres import Spheres
from wavefront.shapes.transform import rotation
from wavefront.stages import compact, reuse
from wavefront.stages.accumulate import accumulate
from wavefront.stages.bounce import _sample, bounce_sample, branch
from wavefront.stages.generate import generate
from wavefront.stages.guidance import mix_with_guide
from wavefront.stages.interaction import interaction, offset_origin, origin_above
from wavefront.stages.intersect import intersect
from wavefront.stages.normal_mapping import ensure_valid_reflection, mirror_hidden, perturb_normals
from wavefront.stages.reuse import (
    FirstPoints,
    SharedPoints,
    _arriving,
    add_shared,
    as_shared,
    attenuate,
    connect,
)
from wavefront.stages.sensors import SENSORS
from wavefront.stages.shade import Guidance, Shading, emitted, shading
from wavefront.statistics.limits import (
    EVENTS,
    UNSEEN,
    event_of,
    light_limits,
    moderated_variance,
    rule_of_three,
)
from wavefront.statistics.region import _steps_of_gain
from wavefront.statistics.significance import _around, _p_of_mean, sidak
from wavefront.statistics.student_t import log_gamma, t_tail
from wavefront.testing.bsdf import _surface, check_bsdf
from wavefront.testing.charts import CHARTS
from wavefront.testing.chi2 import check_density, chi_square
from wavefront.testing.report import Report
from wavefront.textures.base import BaseTexture
from wavefront.textures.image import Texture
from wavefront.textures.normal_map import BumpMap, NormalMap
from wavefront.textures.parameter import scalar
from wavefront.textures.vertex_colors import VertexColors
from wavefront.version import VERSION
from wavefront.viewer import background_denoiser, page, refiner, viewer
from wavefront.viewer.clicked_path import COLORS, LIGHT, PATH, segments_of
from wavefront.viewer.first_paint import FirstPaint, asked_first
from wavefront.viewer.guard import Guard, is_message, is_own_address, token_of
from wavefront.viewer.page import Page
from wavefront.viewer.refiner import Refiner, ViewerFrame
from wavefront.viewer.shown import CHOICES, VIEWER_AOVS, shown_codes
from wavefront.viewer.viewpoint import Viewpoint
from wavefront.workers import executors, machine, pool, remote
from wavefront.workers.executors import MIN_PATHS, MIN_PATHS_TO_SPAWN, choose_executor, worker_count
from wavefront.workers.machine import single_threaded_blas
from wavefront.workers.pool import WorkerPool
from wavefront.workers.processes import ProcessPool
from wavefront.workers.remote import Payload
