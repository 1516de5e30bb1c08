// Elements of the page, made in one expression.

export function made(name, properties, ...children) {
  const element = Object.assign(document.createElement(name), properties);
  element.append(...children);
  return element;
}

export const line = (text, className = "") => made("p", {textContent: text, className});
