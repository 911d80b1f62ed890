// Residuals of the pixels of a tile against the target, and their sums. See `pose_loss/residuals.rs`.
#define_import_path prehend::residuals

#import prehend::derivatives::with_derivatives
#import prehend::goal::TargetPixel
#import prehend::params::{
    KERNEL_CAUCHY, KERNEL_GEMAN_MCCLURE, KERNEL_HUBER, KERNEL_SQUARED, KERNEL_TUKEY, params,
}
#import prehend::pixel::Pixel
#import prehend::row::{Row, scaled_sum}
#import prehend::squares::{first_square, part_index}
#import prehend::sums::{
    SUM_COLOR, SUM_COLUMNS, SUM_CONTOUR, SUM_COVERED, SUM_DEPTH, SUM_GRADIENT, SUM_HESSIAN,
    SUM_HIDDEN, SUM_MASK, SUM_MISSED, SUM_WITH_DEPTH, partials,
}
#import prehend::tallies::region_of
#import prehend::tiles::{TILE, touches_tile}

// One row a thread, so that columns add up in a fixed order; an odd length keeps the banks of memory apart.
var<workgroup> tile_sums: array<f32, 2240>;

// ln(1 + x) for x ≥ 0.
fn log_1p(x: f32) -> f32 {
    if x < 0.01 {
        return x * (1.0 - x * (0.5 - x * (1.0 / 3.0 - 0.25 * x)));
    }
    return log(1.0 + x);
}

// The loss ρ of residual r, and the weight w with dρ/dr = w r.
fn robust_loss(r: f32) -> vec2<f32> {
    let k = params.kernel_scale;
    let x = r * r / (k * k);
    switch params.kernel_kind {
        case KERNEL_HUBER: {
            if abs(r) <= k {
                return vec2<f32>(0.5 * r * r, 1.0);
            }
            return vec2<f32>(k * abs(r) - 0.5 * k * k, k / abs(r));
        }
        case KERNEL_CAUCHY: {
            return vec2<f32>(0.5 * k * k * log_1p(x), 1.0 / (1.0 + x));
        }
        case KERNEL_GEMAN_MCCLURE: {
            let shrink = 1.0 / (1.0 + x);
            return vec2<f32>(0.5 * r * r * shrink, shrink * shrink);
        }
        case KERNEL_TUKEY: {
            let u = min(x, 1.0);
            return vec2<f32>(k * k / 6.0 * u * (3.0 - u * (3.0 - u)), (1.0 - u) * (1.0 - u));
        }
        case KERNEL_SQUARED, default: {
            return vec2<f32>(0.5 * r * r, 1.0);
        }
    }
}

struct Equations {
    gradient: array<f32, 6>,
    hessian: array<f32, 21>,
}

fn add_residual(sums: ptr<function, Equations>, row: Row, r: f32, weight: f32) {
    var v = array<f32, 6>(
        row.linear.x, row.linear.y, row.linear.z, row.angular.x, row.angular.y, row.angular.z,
    );
    var at = 0u;
    for (var i = 0u; i < 6u; i++) {
        let scaled_entry = weight * v[i];
        (*sums).gradient[i] += scaled_entry * r;
        for (var j = i; j < 6u; j++) {
            (*sums).hessian[at] += scaled_entry * v[j];
            at += 1u;
        }
    }
}

// The loss of a pixel of the mask that shows nothing of the object: color, mask.
fn missed_loss(goal_pixel: TargetPixel) -> vec2<f32> {
    var color = 0.0;
    for (var k = 0u; k < 3u; k++) {
        color += robust_loss(goal_pixel.color[k]).x;
    }
    let coverage = goal_pixel.coverage;
    return vec2<f32>(params.color_weight * color, 0.5 * params.mask_weight * coverage * coverage);
}

// Writes the sums of one pixel to this thread's row.
fn store_pixel_sums(lane: u32, pixel: Pixel, goal_pixel: TargetPixel) {
    let row = lane * SUM_COLUMNS;
    for (var i = 0u; i < SUM_COLUMNS; i++) {
        tile_sums[row + i] = 0.0;
    }
    if !pixel.some {
        if goal_pixel.coverage > 0.0 {
            let loss = missed_loss(goal_pixel);
            tile_sums[row + SUM_COLOR] = loss.x;
            tile_sums[row + SUM_MASK] = loss.y;
            tile_sums[row + SUM_MISSED] = 1.0;
        }
        return;
    }
    if goal_pixel.occluder > 0.0 && goal_pixel.occluder < pixel.z {
        tile_sums[row + SUM_HIDDEN] = 1.0;
        if params.penalize_occluded != 0u && goal_pixel.coverage > 0.0 {
            let loss = missed_loss(goal_pixel);
            tile_sums[row + SUM_COLOR] = loss.x;
            tile_sums[row + SUM_MASK] = loss.y;
        }
        return;
    }
    tile_sums[row + SUM_COVERED] = select(0.0, 1.0, pixel.hit);
    tile_sums[row + SUM_CONTOUR] = select(0.0, 1.0, pixel.near_outline);
    var equations: Equations;
    if params.color_weight > 0.0 {
        var loss_sum = 0.0;
        for (var k = 0u; k < 3u; k++) {
            let r = pixel.color[k] - goal_pixel.color[k];
            let loss = robust_loss(r);
            loss_sum += params.color_weight * loss.x;
            if with_derivatives() {
                add_residual(&equations, pixel.color_rows[k], r, params.color_weight * loss.y);
            }
        }
        tile_sums[row + SUM_COLOR] = loss_sum;
    }
    if params.mask_weight > 0.0 {
        let r = pixel.coverage - goal_pixel.coverage;
        tile_sums[row + SUM_MASK] = 0.5 * params.mask_weight * r * r;
        if with_derivatives() && pixel.coverage < 1.0 {
            add_residual(&equations, pixel.coverage_row, r, params.mask_weight);
        }
    }
    if params.depth_weight > 0.0 && pixel.hit && goal_pixel.depth > 0.0 {
        let scale = params.depth_scale;
        let difference = pixel.z - goal_pixel.depth;
        let bounded = clamp(difference, -params.depth_truncation, params.depth_truncation);
        let r = pixel.depth_weight * bounded * scale;
        tile_sums[row + SUM_DEPTH] = 0.5 * params.depth_weight * r * r;
        tile_sums[row + SUM_WITH_DEPTH] = 1.0;
        if with_derivatives() {
            let along = select(0.0, pixel.depth_weight * scale, bounded == difference);
            let depth_row =
                scaled_sum(along, pixel.z_row, bounded * scale, pixel.depth_weight_row);
            add_residual(&equations, depth_row, r, params.depth_weight);
        }
    }
    if with_derivatives() {
        for (var i = 0u; i < 6u; i++) {
            tile_sums[row + SUM_GRADIENT + i] = equations.gradient[i];
        }
        for (var i = 0u; i < 21u; i++) {
            tile_sums[row + SUM_HESSIAN + i] = equations.hessian[i];
        }
    }
}

// Adds up the rows of a tile's threads square by square; the tile has pixels of at least one.
fn store_parts(h: u32, lane: u32, tile: vec2<u32>) {
    let corner = tile * TILE;
    let first = first_square(tile);
    for (var part = 0u; part < params.parts * params.parts; part++) {
        let square = first + vec2<u32>(part % params.parts, part / params.parts);
        let low = clamp(square * params.side, corner, corner + TILE) - corner;
        let high = clamp((square + 1u) * params.side, corner, corner + TILE) - corner;
        var sum = 0.0;
        for (var y = low.y; y < high.y; y++) {
            for (var x = low.x; x < high.x; x++) {
                sum += tile_sums[(y * TILE + x) * SUM_COLUMNS + lane];
            }
        }
        partials[part_index(h, tile, square) * SUM_COLUMNS + lane] = sum;
    }
}

// Adds up the rows of a tile's threads; to be called by a whole workgroup.
fn store_tile_sums(h: u32, lane: u32, tile: vec2<u32>) {
    workgroupBarrier();
    if lane < SUM_COLUMNS && touches_tile(region_of(h), tile) {
        store_parts(h, lane, tile);
    }
}
