//! Curved shapes, cut into triangles fine enough for pictures.

use crate::error::{Place, Result};
use crate::source::Source;

use super::params::Params;
use super::shapes::Surface;

/// Triangles around a full circle, and from pole to pole: a sphere's outline is off by 0.2 %.
const AROUND: usize = 64;
const ALONG: usize = 32;
/// Pieces along a side of a bilinear patch that is not flat.
const PATCH: usize = 8;

/// Whether a sphere is not cut open.
pub(super) fn is_whole(params: &Params) -> bool {
    ["zmin", "zmax", "phimax"].iter().all(|name| params.find(name).is_none())
        && params.float("radius", 1.0) > 0.0
}

/// A grid of `nu` by `nv` pieces over the unit square; `at` gives position, normal and `(u, v)`
/// counted from below. Corners turn left toward `dpdu x dpdv`.
fn grid(
    file: &Source<'_>,
    [nu, nv]: [usize; 2],
    at: impl Fn(f64, f64) -> ([f64; 3], [f64; 3]),
) -> Result<Surface> {
    const WHAT: &str = "a curved shape";
    let vertices = (nu + 1) * (nv + 1);
    let mut positions = file.vec(vertices, WHAT)?;
    let mut normals = file.vec(vertices, WHAT)?;
    let mut uvs = file.vec(vertices, WHAT)?;
    for j in 0..=nv {
        for i in 0..=nu {
            let (u, v) = (i as f64 / nu as f64, j as f64 / nv as f64);
            let (position, normal) = at(u, v);
            positions.push(position.map(|x| x as f32));
            normals.push(normal.map(|x| x as f32));
            uvs.push([u as f32, 1.0 - v as f32]);
        }
    }
    let mut triangles = file.vec(2 * nu * nv, WHAT)?;
    for (i, j) in (0..nv).flat_map(|j| (0..nu).map(move |i| (i, j))) {
        let a = (j * (nu + 1) + i) as u32;
        let (b, c) = (a + 1, a + nu as u32 + 1);
        // Pieces at a pole are triangles.
        let same = |p: u32, q: u32| positions[p as usize] == positions[q as usize];
        if !same(a, b) {
            triangles.push([a, b, c + 1]);
        }
        if !same(c, c + 1) {
            triangles.push([a, c + 1, c]);
        }
    }
    let (normals, uvs) = (Some(normals), Some(uvs));
    Ok(Surface { positions, triangles, normals, uvs, is_quadric: true })
}

/// The angle of a full or cut circle, in radians.
fn phi_max(params: &Params) -> f64 {
    f64::from(params.float("phimax", 360.0)).clamp(0.0, 360.0).to_radians()
}

pub(super) fn sphere(file: &Source<'_>, params: &Params) -> Result<Surface> {
    let radius = f64::from(params.float("radius", 1.0));
    let limit = |name: &str, default: f64| {
        let z = f64::from(params.float(name, default as f32));
        z.clamp(-radius.abs(), radius.abs())
    };
    let (low, high) = (limit("zmin", -radius.abs()), limit("zmax", radius.abs()));
    if radius == 0.0 || low >= high {
        return Ok(Surface::default());
    }
    // From the lower to the upper end, as angles from +z.
    let angle = |z: f64| libm::acos((z / radius.abs()).clamp(-1.0, 1.0));
    let (start, end, phi_max) = (angle(low), angle(high), phi_max(params));
    grid(file, [AROUND, ALONG], |u, v| {
        let theta = start + (end - start) * v;
        let phi = circle(u, phi_max);
        let is_pole = theta <= 0.0 || theta >= core::f64::consts::PI;
        let ring = if is_pole { 0.0 } else { libm::sin(theta) };
        let normal = [ring * libm::cos(phi), ring * libm::sin(phi), libm::cos(theta)];
        (normal.map(|x| x * radius.abs()), normal)
    })
}

/// An angle; the end of a full circle is its very start, so that nothing leaks.
fn circle(u: f64, phi_max: f64) -> f64 {
    let is_full = phi_max >= core::f64::consts::TAU;
    if u >= 1.0 && is_full { 0.0 } else { u * phi_max }
}

pub(super) fn cylinder(file: &Source<'_>, params: &Params) -> Result<Surface> {
    let radius = f64::from(params.float("radius", 1.0));
    let low = f64::from(params.float("zmin", -1.0));
    let high = f64::from(params.float("zmax", 1.0));
    let phi_max = phi_max(params);
    grid(file, [AROUND, 1], |u, v| {
        let phi = circle(u, phi_max);
        let normal = [libm::cos(phi), libm::sin(phi), 0.0];
        ([normal[0] * radius, normal[1] * radius, low + (high - low) * v], normal)
    })
}

pub(super) fn disk(file: &Source<'_>, params: &Params) -> Result<Surface> {
    let radius = f64::from(params.float("radius", 1.0));
    let inner = f64::from(params.float("innerradius", 0.0));
    let height = f64::from(params.float("height", 0.0));
    let phi_max = phi_max(params);
    // v runs from the rim to the middle.
    grid(file, [AROUND, 1], |u, v| {
        let ring = radius + (inner - radius) * v;
        let phi = circle(u, phi_max);
        ([ring * libm::cos(phi), ring * libm::sin(phi), height], [0.0, 0.0, 1.0])
    })
}

/// Patches between four points; a flat one is two triangles.
pub(super) fn bilinear(file: &Source<'_>, params: &Params) -> Result<Surface> {
    let broken = |found: String| {
        Err(file.broken(Place::Line(params.line), found, "check the program that wrote it"))
    };
    let Some(points) = params.groups::<3>(file, "P")? else {
        return broken("a mesh has no points \"P\"".to_owned());
    };
    let default = [0, 1, 2, 3];
    let indices = params.integers("indices").unwrap_or(&default);
    let (patches, rest) = indices.as_chunks::<4>();
    if !rest.is_empty() {
        return broken(format!("{} indices are no patches of four", indices.len()));
    }
    let given = params.groups::<2>(file, "uv")?;
    let mut surface = Surface::default();
    let mut uvs = Vec::new();
    for patch in patches {
        let mut corners = [[0.0; 3]; 4];
        for (corner, &index) in corners.iter_mut().zip(patch) {
            let point = usize::try_from(index).ok().and_then(|index| points.get(index));
            let Some(point) = point else {
                return broken(format!("a patch names point {index} of {}", points.len()));
            };
            *corner = point.map(f64::from);
        }
        let [p00, p10, p01, p11] = corners;
        let is_flat = (0..3).all(|k| p00[k] + p11[k] == p10[k] + p01[k]);
        let pieces = if is_flat { 1 } else { PATCH };
        let piece = grid(file, [pieces; 2], |u, v| {
            let weights = [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v];
            let corner = |k: usize| [p00[k], p10[k], p01[k], p11[k]];
            let mixed = |k: usize| {
                let corner = corner(k);
                weights[0] * corner[0]
                    + weights[1] * corner[1]
                    + weights[2] * corner[2]
                    + weights[3] * corner[3]
            };
            ([mixed(0), mixed(1), mixed(2)], [0.0; 3])
        })?;
        let first = surface.positions.len() as u32;
        file.make_room(&mut surface.positions, piece.positions.len(), "vertex positions")?;
        file.make_room(&mut surface.triangles, piece.triangles.len(), "triangles")?;
        let mut piece_uvs = piece.uvs.unwrap_or_default();
        let corner = |k: usize| given?.get(usize::try_from(patch[k]).ok()?);
        if let (Some(a), Some(b), Some(c), Some(d)) = (corner(0), corner(1), corner(2), corner(3)) {
            for uv in &mut piece_uvs {
                let (u, v) = (uv[0], 1.0 - uv[1]);
                let mixed = |k: usize| {
                    (1.0 - v) * ((1.0 - u) * a[k] + u * b[k]) + v * ((1.0 - u) * c[k] + u * d[k])
                };
                *uv = [mixed(0), 1.0 - mixed(1)];
            }
        }
        file.make_room(&mut uvs, piece_uvs.len(), "texture coordinates")?;
        surface.positions.extend(piece.positions);
        surface.triangles.extend(piece.triangles.iter().map(|t| t.map(|corner| corner + first)));
        uvs.extend(piece_uvs);
    }
    surface.uvs = Some(uvs);
    Ok(surface)
}
