// Keys, and for customers the webhooks to which the events of their deliveries are sent.

import {html} from "../html.js";
import {isOperator, session} from "../session.js";
import {BrandingForm} from "../parts/branding_form.js";
import {AllKeys, OwnKey} from "../parts/key_list.js";
import {WebhookList} from "../parts/webhook_list.js";

export const AccountView = () => html`
  <div class="page">
    <h1>${session.value.role === "customer" ? "Key and webhooks" : "Keys"}</h1>
    ${isOperator() && html`<${AllKeys} />`}
    <${OwnKey} />
    ${session.value.role === "customer" && html`<${WebhookList} /><${BrandingForm} />`}
  </div>`;
