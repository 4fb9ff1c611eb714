// Bands on Q and loads for the reader's texture, from a table of quantiles of ln(p/E), at each key.
"use strict";
for (const form of document.querySelectorAll("form[data-texture]")) {
  const T = JSON.parse(form.parentElement.querySelector("script[type='application/json']").textContent);
  const known = T.calibrated, field = name => form.elements[name];
  const part = name => form.querySelector(`[data-part=${name}]`);
  const LENGTH = { mm: 1e-3, um: 1e-6, m: 1 }, PRESSURE = { Pa: 1, kPa: 1e3, MPa: 1e6 };
  const TAIL = 0.05, SLACK = 1e-12, MARGIN = 1.5;
  const logit = T.prob.map(p => Math.log(p / (1 - p)));

  // A monotone cubic through points of rising x (Fritsch and Butland), linear beyond its ends.
  const through = (x, y) => {
    const n = x.length, h = [], d = [], m = [];
    for (let i = 0; i < n - 1; i++) { h.push(x[i + 1] - x[i]); d.push((y[i + 1] - y[i]) / h[i]); }
    for (let i = 1; i < n - 1; i++) {
      const v = 2 * h[i] + h[i - 1], w = h[i] + 2 * h[i - 1];
      m[i] = d[i - 1] * d[i] > 0 ? (v + w) / (v / d[i - 1] + w / d[i]) : 0;
    }
    m[0] = d[0]; m[n - 1] = d[n - 2];
    return at => {
      if (n < 2) return y[0];
      if (at <= x[0]) return y[0] + m[0] * (at - x[0]);
      if (at >= x[n - 1]) return y[n - 1] + m[n - 1] * (at - x[n - 1]);
      let i = 0;
      while (at >= x[i + 1]) i++;
      const t = (at - x[i]) / h[i], r = 1 - t;
      return y[i] * r * r * (1 + 2 * t) + h[i] * m[i] * t * r * r
        + y[i + 1] * t * t * (3 - 2 * t) - h[i] * m[i + 1] * t * t * r;
    };
  };

  // P(standard normal <= z), to 1e-7 (Abramowitz and Stegun 26.2.17).
  const normal = z => {
    const t = 1 / (1 + 0.2316419 * Math.abs(z));
    const tail = Math.exp(-z * z / 2) * 0.3989422804014327 * t * (0.31938153 + t
      * (-0.356563782 + t * (1.781477937 + t * (-1.821255978 + t * 1.330274429))));
    return z > 0 ? 1 - tail : tail;
  };

  // A distribution of ln load, by points of the logit of its distribution function. Draws
  // that reach the count at no load are missing at the upper end, from the probability `top` on.
  const distribution = (y, score, top) => {
    const up = through(y, score), back = through(score, y);
    return {
      y, score, top,
      cdf: at => y.length < 2 ? 0 : Math.min(1 / (1 + Math.exp(-up(at))), top),
      quantile: p => y.length < 2 || p > top ? Infinity : back(Math.log(p / (1 - p))),
    };
  };

  // The distribution with an additional independent normal error of ln load.
  const widened = (one, sd) => {
    if (!sd || one.y.length < 2) return one;
    const n = 400, middles = [];
    for (let i = 0; i < n; i++) middles.push(one.quantile((i + 0.5) / n * one.top));
    const low = one.y[0] - 4 * sd, high = one.y.at(-1) + 4 * sd, y = [], score = [];
    for (let i = 0; i <= 60; i++) {
      const at = low + (high - low) * i / 60;
      const p = one.top * middles.reduce((sum, q) => sum + normal((at - q) / sd), 0) / n;
      const s = Math.log(p / (1 - p));
      if (p > 1e-5 && p < 1 - 1e-5 && !(s <= score.at(-1))) { y.push(at); score.push(s); }
    }
    return distribution(y, score, one.top);
  };

  // Distributions of ln(p/E) of all counts, for an a/pitch and a pitch of R.
  const atRatio = ratio => T.Q.map((_, k) => {
    const y = [], width = T.prob.length;
    for (let j = 0; j < width; j++) {
      const column = T.ratio.map((_, i) => T.g[(i * T.Q.length + k) * width + j]);
      const here = column.map((g, i) => [T.ratio[i], g]).filter(([, g]) => g !== null);
      const i = T.ratio.findIndex(one => one >= ratio);
      if (column[i] === null || column[Math.max(i - 1, 0)] === null) break;
      const value = T.unit * through(here.map(one => one[0]), here.map(one => one[1]))(ratio);
      y.push(Math.max(value, (y.at(-1) ?? -Infinity) + 1e-9));  // rounded ones may be alike
    }
    return distribution(y, logit.slice(0, y.length), y.length < width ? T.prob[y.length - 1] ?? 0 : 1);
  });

  const digits = (x, n = 3) => {
    if (!Number.isFinite(x)) return "–";
    if (x !== 0 && (Math.abs(x) < 1e-4 || Math.abs(x) >= 1e6)) return x.toExponential(n - 1);
    return String(Number(x.toPrecision(n)));
  };
  const percent = p => p > 0.9995 ? "> 99.9 %" : p < 0.0005 ? "< 0.1 %" : `${(100 * p).toFixed(1)} %`;

  // The typed values, or the invalid fields with their rules.
  const read = () => {
    const bad = [], number = (name, rule, ok) => {
      const value = Number(field(name).value.trim().replace(",", ".") || NaN);
      field(name).setAttribute("aria-invalid", !ok(value));
      if (!ok(value)) bad.push(`${field(name).ariaLabel}: ${rule}`);
      return value;
    };
    const positive = x => x > 0 && x < Infinity, share = x => x >= 0 && x <= 50;
    const R = number("R", "a number above 0", positive) * LENGTH[field("R_unit").value];
    const E = number("E", "a number above 0", positive) * PRESSURE[field("E_unit").value];
    const sdR = number("R_sd", "0 to 50 %", share) / 100, sdE = number("E_sd", "0 to 50 %", share) / 100;
    const nu = number("nu", "0 to 0.5", x => x >= 0 && x <= 0.5);
    const unit = field("width_unit").value, scale = unit === "R" ? 1 : LENGTH[unit] / R;
    const a = number("a", "a number above 0", positive) * scale;
    const b = number("b", "a number above 0", positive) * scale;
    const ends = field("load").value.replaceAll(",", ".").split(/\s*(?:to|:|–)\s*/).map(x => Number(x.trim() || NaN));
    const fine = ends.length < 3 && ends.every(positive) && ends[0] <= ends.at(-1);
    field("load").setAttribute("aria-invalid", !fine);
    if (!fine) bad.push("Load: a number above 0, or a range such as 0.2 to 1.2");
    // The load at which p = E, and how errors of E and R move it at a given Q.
    const of = field("load_unit").value;
    const perE = of === "p/E" ? 1 : of === "N/m" ? 2 * R * E : E / PRESSURE[of];
    const slopeR = (of === "N/m" ? 1 : 0) - (unit === "R" ? 0 : 2);
    const sd = Math.hypot(of === "p/E" ? 0 : Math.log1p(sdE), slopeR * Math.log1p(sdR));
    return { bad, a, b, nu, ends, unit: of, perE, sd };
  };

  // Quantities of texture, load and counts outside the calibrated range, and their distance from it.
  const beyond = (x, load, upper) => {
    const found = [], outside = (name, value, [low, high], margin, label = name) => {
      const [end, side] = value > high * margin * (1 + SLACK) ? [high, "largest"]
        : value < low / margin * (1 - SLACK) ? [low, "smallest"] : [];
      if (end) found.push([name, `${label} = ${digits(value)} is ${digits(value / end, 2)} times the ${side} calibrated, ${digits(end)}`]);
    };
    const p = load / x.perE * (1 - x.nu ** 2) / 0.75;
    if (upper > known.Q_max) found.push(["Q", `the band reaches Q = ${upper}, calibrated up to ${known.Q_max}`]);
    outside("load", p, [0, known.p_over_E_max], 1, "p/E");
    outside("a/pitch", x.a / (x.a + x.b), known.a_over_pitch, 1);
    outside("a/R", x.a, known.a_over_R, MARGIN);
    outside("b/R", x.b, known.b_over_R, MARGIN);
    if (T.power_law && !T.fitted.some(([a, b]) => same(a, x.a) && same(b, x.b)))
      found.push(["texture", "the power law has no K for this texture"]);
    return found;
  };
  const same = (one, other) => Math.abs(one / other - 1) < 1e-9;

  // Curves of Q are steps at load quantiles; a farther ridge is never reached before a nearer one.
  const draw = (x, steps, top) => {
    const W = 480, H = 260, left = 52, right = 12, above = 10, below = 44;
    const reached = steps.high.filter(load => load < top).length;
    const Qtop = T.Q[Math.min(reached, T.Q.length - 1)];
    const X = load => left + (W - left - right) * load / top;
    const Y = Q => H - below - (H - above - below) * (Q - 2) / Math.max(Qtop - 2, 2);
    const path = loads => {
      let d = `M${X(0)},${Y(2)}`;
      loads.forEach((load, k) => { if (load < top) d += `H${X(load).toFixed(1)}V${Y(T.Q[k]).toFixed(1)}`; });
      return `${d}H${X(top)}`;
    };
    const back = loads => {
      let d = "", Q = 2 + 2 * loads.filter(load => load < top).length;
      d += `V${Y(Q).toFixed(1)}`;
      for (let k = loads.length - 1; k >= 0; k--)
        if (loads[k] < top) d += `H${X(loads[k]).toFixed(1)}V${Y(T.Q[k] - 2).toFixed(1)}`;
      return d + "Z";
    };
    const power = 10 ** Math.floor(Math.log10(top / 4)), step = [1, 2, 5, 10].find(s => top / (s * power) <= 6) * power;
    let svg = "";
    for (let load = 0; load <= top * 1.0001; load += step)
      svg += `<text x="${X(load)}" y="${H - below + 18}" text-anchor="middle">${digits(load)}</text>`;
    const every = 2 * Math.ceil((Qtop - 2) / 16);
    for (let Q = 2; Q <= Qtop; Q += every)
      svg += `<text x="${left - 8}" y="${Y(Q) + 4}" text-anchor="end">${Q}</text><path class="grid" d="M${left},${Y(Q)}H${W - right}"/>`;
    svg += `<path class="band" d="${path(steps.high)}${back(steps.low)}"/><path class="median" d="${path(steps.median)}"/>`;
    const end = known.p_over_E_max * 0.75 / (1 - x.nu ** 2) * x.perE;
    if (end < top) svg += `<path class="end" d="M${X(end)},${above}V${H - below}"/><text x="${X(end) - 5}" y="${above + 12}" text-anchor="end">calibrated</text>`;
    for (const load of x.ends) svg += `<path class="load" d="M${X(load)},${above}V${H - below}"/>`;
    svg += `<text x="${(W + left) / 2}" y="${H - 6}" text-anchor="middle">load in ${x.unit}</text>`;
    svg += `<text transform="translate(14,${(H - below + above) / 2}) rotate(-90)" text-anchor="middle">edges in contact Q</text>`;
    part("plot").innerHTML = svg;
  };

  const update = () => {
    const x = read(), ratio = x.a / (x.a + x.b), last = T.ratio.length - 1;
    let told = x.bad.length ? `Expected ${x.bad.join("; ")}.` : "";
    if (!told && !(ratio >= T.ratio[0] && ratio <= T.ratio[last]))
      told = `This page knows a/pitch from ${T.ratio[0]} to ${T.ratio[last]}, and this is ${digits(ratio)}: use ridgebayes predict.`;
    part("answer").hidden = Boolean(told);
    part("told").textContent = told;
    if (told) return;
    const shift = 2 * Math.log(x.a + x.b) - Math.log((1 - x.nu ** 2) / 0.75) + Math.log(x.perE);
    const counts = atRatio(ratio).map(one => widened(one, x.sd));
    const load = x.ends.at(-1), survival = [];
    // Under Student errors no load reaches counts beyond the body's width.
    const widest = 2 + 2 * Math.floor(Math.max(1 - x.b / 2, 0) / (x.a + x.b));
    counts.forEach((one, k) => survival.push(
      Math.min(one.cdf(Math.log(load) - shift), T.Q[k] > widest ? T.normal : 1, survival.at(-1) ?? 1)));
    const at = p => counts.map(one => Math.exp(one.quantile(p) + shift));
    const loads = { high: at(TAIL), median: at(0.5), low: at(1 - TAIL) };
    const rising = values => values.reduce((found, one) => [...found, Math.max(one, found.at(-1) ?? 0)], []);
    const steps = { high: rising(loads.high), median: rising(loads.median), low: rising(loads.low) };
    // The smallest q with P(Q <= q) >= p.
    const quantile = p => 2 * (survival.findIndex(s => 1 - s >= p * (1 - SLACK)) + 1 || survival.length + 1);
    const [low, middle, high] = [TAIL, 0.5, 1 - TAIL].map(quantile);
    const more = high === T.Q.at(-1) ? " or more" : "", found = beyond(x, load, high);
    part("said").textContent = `At ${digits(load)} ${x.unit}` + (x.unit === "p/E" ? "" : ` (p/E = ${digits(load / x.perE)})`)
      + `: Q = ${middle}, 90\u00a0% band ${low === high ? high : `${low} to ${high}`}${more}.`;
    const own = T.knows && T.fitted.some(([a, b]) => same(a, x.a) && same(b, x.b));
    part("beyond").textContent = (found.length ? `Extrapolation: ${found.map(one => one[1]).join("; ")}.` : "Nothing is extrapolated.")
      + (own ? " This texture was fitted: ridgebayes predict uses its own offset, this page takes it as a new one." : "");
    part("beyond").dataset.of = found.map(one => one[0]).join(",");
    Object.assign(part("said").dataset, { low, median: middle, high });
    const rows = T.Q.map((Q, k) => {
      const cells = [loads.median, loads.high, loads.low].map(each => each[k]);
      const names = ["Q", "load"].filter((_, i) => i ? cells[0] / x.perE * (1 - x.nu ** 2) / 0.75 > known.p_over_E_max * (1 + SLACK) : Q > known.Q_max);
      return `<tr data-load="${cells.join(" ")}" data-p="${survival[k]}"><th scope="row">${Q}</th><td class="n">${percent(survival[k])}</td>`
        + `<td class="n">${digits(cells[0], 4)}</td><td class="n">${digits(cells[1], 4)} to ${digits(cells[2], 4)}</td><td>${names.join(", ") || "–"}</td></tr>`;
    });
    part("rows").innerHTML = rows.slice(0, Math.max(high / 2 + 1, 4)).join("");
    part("unit").textContent = x.unit;
    part("plot").setAttribute("aria-label", `Q against load with its 90 % band. ${part("said").textContent}`);
    draw(x, steps, load * 1.25);
  };

  form.addEventListener("input", update);
  form.addEventListener("reset", () => setTimeout(update));
  form.addEventListener("submit", event => event.preventDefault());
  form.hidden = false;
  update();
}
