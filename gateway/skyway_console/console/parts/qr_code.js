// A text as a QR code, dark on light in both themes, because cameras want it so.

import qrcode from "qrcode-generator";

import {html} from "../html.js";

// Modules of quiet ground around the code, as the standard asks.
const QUIET = 4;

// One path of unit squares.
function squares(code) {
  const numbers = Array.from({length: code.getModuleCount()}, (_, n) => n);
  return numbers.flatMap((row) => numbers
    .filter((column) => code.isDark(row, column))
    .map((column) => `M${column + QUIET} ${row + QUIET}h1v1h-1z`)).join("");
}

export function QrCode({text, label}) {
  const code = qrcode(0, "M");
  code.addData(text);
  code.make();
  const size = code.getModuleCount() + 2 * QUIET;
  return html`
    <svg class="qr-code" viewBox=${`0 0 ${size} ${size}`} role="img" aria-label=${label}
      shape-rendering="crispEdges">
      <rect width=${size} height=${size} fill="#ffffff" />
      <path d=${squares(code)} fill="#000000" />
    </svg>`;
}
