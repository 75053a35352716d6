// What surfaces do with light: matte, mirror, rough metal and glass.
//
// A site has wo, the unit direction back along the path; the normal on its side; the surface's reflectance;
// beta, the throughput on arrival; and what its kind needs: roughness, or ior and isOutside (SHD-3).

import {
  concentricDisk,
  cosineHemisphere,
  cosineHemispherePdf,
  toLocal,
  toWorld,
} from "./sampling.mjs";
import { add, cross, dot, multiply, negate, scale, subtract, ZERO } from "./vectors.mjs";
import { clip } from "./numbers.mjs";

// MAT-2: the density of directions that no light sample can take.
export const SINGLE_PDF = 1e30;

const LEAST_SQUARE = 1e-30;
const LEAST_DIVISOR = 1e-30;
const LEAST_HEIGHT = 1e-7;

// MAT-3
function unit(w) {
  return scale(w, 1 / Math.sqrt(Math.max(dot(w, w), LEAST_SQUARE)));
}

// MAT-3
export function mirrored(wo, normal) {
  const cosine = clip(dot(normal, wo), 0, 1);
  return unit(subtract(scale(normal, 2 * cosine), wo));
}

// LAM-1
const lambertian = {
  isSingle: false,
  sample(site, u0, u1) {
    const local = cosineHemisphere(u0, u1);
    return {
      direction: toWorld(local, site.normal),
      beta: multiply(site.beta, site.reflectance),
      pdf: cosineHemispherePdf(local[2]),
      isTransmitted: false,
    };
  },
  value(site, wi) {
    const cosine = Math.max(dot(site.normal, wi), 0);
    return scale(multiply(site.beta, site.reflectance), cosine / Math.PI);
  },
  pdf(site, wi) {
    return cosineHemispherePdf(Math.max(dot(site.normal, wi), 0));
  },
};

// MIR-1
const mirror = {
  isSingle: true,
  sample(site) {
    return {
      direction: mirrored(site.wo, site.normal),
      beta: multiply(site.beta, site.reflectance),
      pdf: SINGLE_PDF,
      isTransmitted: false,
    };
  },
  value: () => ZERO,
  pdf: () => 0,
};

const atLeast = (divisor) => Math.max(divisor, LEAST_DIVISOR);

// CDR-1
export function ggx(m, alpha) {
  const [x, y, z] = m;
  const square = alpha * alpha;
  const spread = x * x + y * y + square * z * z;
  return square / atLeast(Math.PI * spread * spread);
}

// The q of the chapter on rough metal.
function stretchedLength(w, alpha) {
  return Math.sqrt(w[2] * w[2] + alpha * alpha * (w[0] * w[0] + w[1] * w[1]));
}

// CDR-3: the normal of a microscopic mirror in local terms, as seen from wo.
export function visibleNormal(wo, alpha, u0, u1) {
  const a = unit([alpha * wo[0], alpha * wo[1], wo[2]]);
  const square = a[0] * a[0] + a[1] * a[1];
  const t = square < LEAST_SQUARE ? [1, 0, 0] : scale([-a[1], a[0], 0], 1 / Math.sqrt(square));
  const b = cross(a, t);
  const s = (1 + a[2]) / 2;
  const [x, y] = concentricDisk(u0, u1);
  const shifted = (1 - s) * Math.sqrt(Math.max(0, 1 - x * x)) + s * y;
  const height = Math.sqrt(Math.max(0, 1 - x * x - shifted * shifted));
  const n = add(add(scale(t, x), scale(b, shifted)), scale(a, height));
  return unit([alpha * n[0], alpha * n[1], Math.max(0, n[2])]);
}

// CDR-4
export function schlick(reflectance, cosine) {
  const fifth = clip(1 - cosine, 0, 1) ** 5;
  return reflectance.map((share) => share + (1 - share) * fifth);
}

// Directions of the chapter on rough metal: local, with heights that are not negative.
function localWo(site) {
  const [x, y, z] = toLocal(site.wo, site.normal);
  return [x, y, Math.max(z, LEAST_HEIGHT)];
}

// CDR-2 to CDR-4
const conductor = {
  isSingle: false,
  sample(site, u0, u1) {
    const alpha = site.roughness;
    const wo = localWo(site);
    const m = visibleNormal(wo, alpha, u0, u1);
    const cosine = dot(wo, m);
    const wi = subtract(scale(m, 2 * cosine), wo);
    const [zi, zo] = [Math.max(wi[2], 0), wo[2]];
    const qo = stretchedLength(wo, alpha);
    const qi = stretchedLength([wi[0], wi[1], zi], alpha);
    const kept = (zi * (qo + zo)) / atLeast(qo * zi + qi * zo);
    return {
      direction: unit(toWorld(wi, site.normal)),
      beta: scale(multiply(site.beta, schlick(site.reflectance, cosine)), kept),
      pdf: ggx(m, alpha) / atLeast(2 * (qo + zo)),
      isTransmitted: false,
    };
  },
  value(site, wi) {
    const alpha = site.roughness;
    const { wo, m, local } = half(site, wi);
    const [zi, zo] = [local[2], wo[2]];
    const shared = stretchedLength(wo, alpha) * zi + stretchedLength(local, alpha) * zo;
    const factor = (ggx(m, alpha) * zi) / atLeast(2 * shared);
    return scale(multiply(site.beta, schlick(site.reflectance, dot(wo, m))), factor);
  },
  pdf(site, wi) {
    const { wo, m } = half(site, wi);
    return ggx(m, site.roughness) / atLeast(2 * (stretchedLength(wo, site.roughness) + wo[2]));
  },
};

// CDR-2: both directions in local terms, and the unit vector between them.
function half(site, wi) {
  const wo = localWo(site);
  const [x, y, z] = toLocal(wi, site.normal);
  const local = [x, y, Math.max(z, 0)];
  return { wo, local, m: unit(add(wo, local)) };
}

// DIE-2: the refracted direction, and its cosine behind the surface.
export function refract(wo, normal, ratio) {
  const cosine = clip(dot(normal, wo), 0, 1);
  const behind = Math.sqrt(Math.max(0, (1 - ratio) * (1 + ratio) + (ratio * cosine) ** 2));
  const direction = unit(subtract(scale(normal, ratio * cosine - behind), scale(wo, ratio)));
  return { direction, cosine, behind };
}

// DIE-3
export function fresnel(cosine, behind, ratio) {
  if (behind === 0 && ratio > 1) return 1;
  const across = (cosine - ratio * behind) / atLeast(cosine + ratio * behind);
  const along = (ratio * cosine - behind) / atLeast(ratio * cosine + behind);
  return 0.5 * (across * across + along * along);
}

// DIE-4
const dielectric = {
  isSingle: true,
  sample(site, u0, u1, choice) {
    const ratio = site.isOutside ? 1 / site.ior : site.ior;
    const { direction, cosine, behind } = refract(site.wo, site.normal, ratio);
    const isTransmitted = choice >= fresnel(cosine, behind, ratio);
    return {
      direction: isTransmitted ? direction : mirrored(site.wo, site.normal),
      beta: multiply(site.beta, site.reflectance),
      pdf: SINGLE_PDF,
      isTransmitted,
    };
  },
  value: () => ZERO,
  pdf: () => 0,
};

export const MATERIALS = { lambertian, mirror, conductor, dielectric };

// SHD-3, DIE-1: the vertex of a path on a surface.
export function siteOf(surface, point, normal, reflectance, direction, beta) {
  const { material, center } = surface;
  const isOutside = center === undefined || dot(normal, subtract(point, center)) > 0;
  const { roughness, ior } = material;
  return { wo: negate(direction), normal, reflectance, beta, roughness, ior, isOutside };
}
