// Posterior probabilities of the forms from the reader's prior probabilities and the evidences.
"use strict";
for (const form of document.querySelectorAll("form[data-odds]")) {
  const inputs = [...form.querySelectorAll("input")];
  const outputs = [...form.querySelectorAll("output")];
  const status = form.querySelector("[role=status]");

  // Probabilities as in the report: rounding never gives 0 or 1.
  const written = p => {
    if (p === 1) return "1";
    if (p > 0.9999) return "> 0.9999";
    if (p > 0.999) return p.toFixed(5);
    if (p >= 0.01 || p === 0) return p.toFixed(p ? 3 : 0);
    if (p >= 1e-5) return String(Number(p.toPrecision(2)));
    const [digits, power] = p.toExponential(1).split("e");
    const raised = [...power].map(c => "⁰¹²³⁴⁵⁶⁷⁸⁹"[c] ?? (c === "-" ? "⁻" : "")).join("");
    return `${digits} × 10${raised}`;
  };

  const update = () => {
    const priors = inputs.map(one => Number(one.value.trim().replace(",", ".") || NaN));
    const bad = priors.map(prior => !(prior >= 0 && prior < Infinity));
    inputs.forEach((one, i) => one.setAttribute("aria-invalid", bad[i]));
    const usable = !bad.includes(true) && priors.some(prior => prior > 0);
    status.textContent = usable ? "" : "Type a number of 0 or more for each form, one above 0.";
    // Logarithms, because ln evidences differ by hundreds.
    const logs = priors.map((prior, i) => Math.log(prior) + Number(inputs[i].dataset.evidence));
    const top = Math.max(...logs);
    const weights = logs.map(log => Math.exp(log - top));
    const sum = weights.reduce((a, b) => a + b, 0);
    outputs.forEach((one, i) => { one.textContent = usable ? written(weights[i] / sum) : "–"; });
  };

  form.addEventListener("input", update);
  form.addEventListener("reset", () => setTimeout(update));
  form.addEventListener("submit", event => event.preventDefault());
  form.hidden = false;
  update();
}
