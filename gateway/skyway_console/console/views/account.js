// Keys, and for customers the webhooks to which the events of their deliveries are sent.

import {html} from "../html.js";
import {session} from "../session.js";
import {BrandingForm} from "../parts/branding_form.js";
import {KeyList, OwnKey} from "../parts/key_list.js";
import {WebhookList} from "../parts/webhook_list.js";

export const AccountView = () => html`
  <div class="page">
    <h1>${session.value.role === "customer" ? "Keys and webhooks" : "Keys"}</h1>
    ${session.value.role !== "provider" && html`<${KeyList} />`}
    <${OwnKey} />
    ${session.value.role === "customer" && html`<${WebhookList} /><${BrandingForm} />`}
  </div>`;
