// What is typed into a form, and sending it.

// What was given: without empty texts and lists.
export const given = (members) => Object.fromEntries(
  Object.entries(members).filter(([, value]) => value !== undefined && value.length !== 0));

// Answers what a form does when it is sent: `valueOf` makes what `onMake` sends of the form's texts, by their names,
// and of its data. A form whose content was accepted is empty again.
export const sending = (valueOf, onMake) => async (event) => {
  event.preventDefault();
  const form = event.target;
  const values = new FormData(form);
  const texts = Object.fromEntries([...values].map(([name, text]) => [name, text.trim()]));
  if (await onMake(valueOf(texts, values))) form.reset();
};
