export function CampaignScreen({ id }: { id: string }) {
  return (
    <h1>
      Campaign {id}
    </h1>
  );
}
