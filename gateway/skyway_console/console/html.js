// Markup in JavaScript: texts are always escaped, so that nobody's name becomes markup.

import {h} from "preact";
import htm from "htm";

export const html = htm.bind(h);
